import pytest

from hopping_leg.cli import main
from hopping_leg.cli.doctor import PURPOSES, missing_requirements
from tests.extras import TRAINING, run_without


def test_what_is_missing_or_too_old_is_named_unless_for_another_platform():
    lines = ["numpy>=1", "no-such-package>=2; extra == 'view'", "numpy>=999; extra == 'cluster'"]
    lines.append("no-such-package; platform_machine == 'pdp11' and extra == 'hardware'")
    found = missing_requirements(lines)
    assert set(found) == set(PURPOSES)
    assert {extra: missing for extra, missing in found.items() if missing} == {
        "view": ["no-such-package>=2"],
        "cluster": ["numpy>=999"],
    }


def test_an_extra_of_another_package_counts(monkeypatch):
    theirs = {"numpy": ["no-such-package; extra == 'fast'", "scipy; extra == 'good'"]}
    monkeypatch.setattr("hopping_leg.cli.doctor.requires", theirs.get)
    lines = ["numpy[fast]>=1; extra == 'cluster'", "numpy[good]; extra == 'view'"]
    found = missing_requirements(lines)
    assert found["cluster"] == ["numpy[fast]>=1"]
    assert not found["view"]


def test_doctor_without_a_transport_looks_at_the_installation(monkeypatch, capsys):
    monkeypatch.setattr("hopping_leg.cli.doctor.requires", lambda _: ["nothing; extra == 'view'"])
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert "view: missing nothing" in shown
    assert "pip install 'hopping-leg[view]'" in shown
    assert "train: installed" in shown


def test_drives_cannot_be_changed_without_a_transport(refused):
    refused(["doctor", "--write"], "name their --transport")


OPTIONAL = [
    *(*TRAINING, "ray"),
    *("moteus", "can", "serial", "viser", "playwright"),
]
HARDWARE = "pip install 'hopping-leg[hardware]'"


@pytest.mark.parametrize(
    ("words", "exit_code", "said"),
    [
        (["doctor"], 0, "hardware: "),
        (["emulate", "--kinds"], 0, "late_reply"),
        (["train"], 2, "pip install 'hopping-leg[train]'"),
        (["emulate"], 2, HARDWARE),
        (["doctor", "--transport", "/dev/null"], 2, HARDWARE),
        (["deploy", "energy-shaping", "--transport", "/dev/null"], 2, HARDWARE),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_core_says_what_there_is_and_which_extra_a_verb_needs(words, exit_code, said):
    code = f"from hopping_leg.cli import main\nraise SystemExit(main({words!r}))"
    done = run_without(OPTIONAL, code)
    assert done.returncode == exit_code, done.stderr
    assert said in (done.stderr if exit_code else done.stdout)
    assert "Traceback" not in done.stderr
