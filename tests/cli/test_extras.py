import subprocess
import sys

from hopping_leg.cli import main
from hopping_leg.cli.extras import PURPOSES, survey


def test_what_is_missing_or_too_old_is_named_with_its_command():
    lines = ["numpy>=1", "no-such-package>=2; extra == 'view'", "numpy>=999; extra == 'tune'"]
    found = {extra.name: extra for extra in survey(lines)}
    assert set(found) == set(PURPOSES)
    assert found["view"].missing == ("no-such-package>=2",)
    assert found["tune"].missing == ("numpy>=999",)
    assert found["train"].missing == ()
    assert found["view"].command == "pip install 'hopping-leg[view]'"


def test_an_extra_of_another_package_counts(monkeypatch):
    theirs = {"numpy": ["no-such-package; extra == 'fast'", "scipy; extra == 'good'"]}
    monkeypatch.setattr("hopping_leg.cli.extras.requires", theirs.get)
    lines = ["numpy[fast]>=1; extra == 'bench'", "numpy[good]; extra == 'view'"]
    found = {extra.name: extra for extra in survey(lines)}
    assert found["bench"].missing == ("numpy[fast]>=1",)
    assert found["view"].missing == ()


def test_a_package_for_another_platform_is_not_missing():
    line = "no-such-package; platform_machine == 'pdp11' and extra == 'pi3hat'"
    assert all(not extra.missing for extra in survey([line]))


def test_doctor_without_a_transport_looks_at_the_installation(monkeypatch, capsys):
    monkeypatch.setattr("hopping_leg.cli.extras.requires", lambda _: ["nothing; extra == 'view'"])
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert "view: missing nothing" in shown
    assert "pip install 'hopping-leg[view]'" in shown
    assert "train: installed" in shown


def test_drives_cannot_be_changed_without_a_transport(capsys):
    assert main(["doctor", "--write"]) == 2
    assert "name their --transport" in capsys.readouterr().err


WITHOUT_EXTRAS = """
import sys
class Block:
    def find_spec(self, name, *_):
        if name.split(".")[0] in ("moteus", "can", "serial", "msgpack", "torch", "viser", "ray"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Block())
from hopping_leg.cli import main
raise SystemExit(main(["doctor"]))
"""


def test_doctor_needs_no_extra_itself():
    done = subprocess.run([sys.executable, "-c", WITHOUT_EXTRAS], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "hardware: " in done.stdout
