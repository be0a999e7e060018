import contextlib
import io
import shutil
import subprocess

import pytest

from hopping_leg import cli


@pytest.fixture(scope="module")
def bash(tmp_path_factory):
    """The script for bash; completing runs it as the shell does."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        assert cli.main(["--tyro-print-completion", "bash"]) == 0
    file = tmp_path_factory.mktemp("bash") / "hop"
    file.write_text(text.getvalue())

    def complete(*words):
        code = (
            f'source {file}; COMP_WORDS=("$@"); COMP_CWORD={len(words) - 1};'
            ' _tyro_hop; printf "%s\\n" "${COMPREPLY[@]}"'
        )
        done = subprocess.run(["bash", "-c", code, "-", *words], capture_output=True, text=True)
        return done.stdout.split()

    return complete


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("hop", "repr"), ["reproduce"]),
        (("hop", "train", "--rec"), ["--recipe"]),
        (("hop", "train", "--log", "tr"), ["trackio"]),
        (("hop", "robots", "sh"), ["show"]),
    ],
)
def test_bash_completes_verbs_options_choices_and_subcommands(bash, words, found):
    assert bash(*words) == found


def test_other_shells_know_every_verb_and_another_is_refused(capsys, refused):
    for shell in ("zsh", "fish"):
        assert cli.main(["--tyro-print-completion", shell]) == 0
        text = capsys.readouterr().out
        assert all(verb in text for verb in (*cli.VERBS, "recipe"))
    refused(["--tyro-print-completion", "tcsh"], "There is no shell 'tcsh'")
