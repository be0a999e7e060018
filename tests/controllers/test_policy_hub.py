"""Policies go to the hub with a card that it renders, and come back checked."""

import importlib

import pytest

from hopping_leg.cli import main
from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.errors import PolicyError

pytest.importorskip("huggingface_hub", reason="the extra 'hub' is not installed")
import huggingface_hub

from hopping_leg.controllers import policy_hub
from tests.controllers.hub import serve


@pytest.fixture
def hub(monkeypatch, tmp_path):
    with serve() as (hub, address):
        with monkeypatch.context() as patch:
            patch.setenv("HF_ENDPOINT", address)
            patch.setenv("HF_TOKEN", hub.token)
            patch.chdir(tmp_path)
            importlib.reload(huggingface_hub.constants)
            yield hub
        importlib.reload(huggingface_hub.constants)


def test_a_policy_comes_back_as_it_was_pushed(hub, tmp_path, capsys):
    assert main(["policies", "push", "fast", "me/fast-leg"]) == 0
    assert "me/fast-leg/commit/" in capsys.readouterr().out
    assert main(["policies", "list", "--hub"]) == 0
    assert "me/fast-leg" in capsys.readouterr().out
    assert main(["policies", "pull", "me/fast-leg"]) == 0
    folder = tmp_path / "runs" / "fast-leg"
    assert (folder / "policy.onnx").read_bytes() == load_policy("fast").content
    said = capsys.readouterr().out
    assert hub.commit("me/fast-leg") in said
    command = said.rpartition("Try it: hop ")[2].split()
    assert load_policy(command[1]).digest == load_policy("fast").digest
    assert main(["policies", "push", str(folder / "policy.onnx"), "me/again", "--private"]) == 0
    assert hub.private == {"me/again"}
    assert hub.repositories["me/again"] == hub.repositories["me/fast-leg"]


@pytest.mark.parametrize("name", shipped_policies())
def test_cards_of_shipped_policies_are_model_cards(name):
    policy = load_policy(name)
    card = huggingface_hub.ModelCard(policy_hub.hub_card(policy))
    assert card.data.library_name == card.data.tags[0] == policy_hub.TAG
    assert card.data.pipeline_tag == "robotics"
    assert f"robot:{policy.card.robot}" in card.data.tags
    assert card.text.startswith("# Policy")


def test_front_matter_of_ones_own_is_kept_and_a_policy_without_card_is_refused(tmp_path):
    path = tmp_path / "policy.onnx"
    path.write_bytes(load_policy("fast").content)
    with pytest.raises(PolicyError, match=r"has no card; put a model_card\.md beside it"):
        policy_hub.hub_card(load_policy(path))
    (tmp_path / "model_card.md").write_text("---\nlicense: mit\n---\n# Mine")
    assert huggingface_hub.ModelCard(policy_hub.hub_card(load_policy(path))).data.license == "mit"


def refused(*words, capsys):
    assert main(["policies", *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_what_is_no_policy_is_refused_and_nothing_is_written(hub, tmp_path, capsys, monkeypatch):
    hub.repositories["me/other"] = {"model.bin": b"x"}
    assert "holds no policy.onnx" in refused("pull", "me/other", capsys=capsys)
    hub.repositories["me/bad"] = {"policy.onnx": load_policy("fast").content[:-9]}
    assert "not a readable ONNX file" in refused("pull", "me/bad", capsys=capsys)
    monkeypatch.setattr(policy_hub, "LARGEST", 1000)
    hub.downloads.clear()
    assert "not downloaded" in refused("pull", "me/bad", capsys=capsys)
    assert hub.downloads == []
    assert not (tmp_path / "runs").exists()


def test_what_the_hub_refuses_is_one_sentence(hub, capsys, monkeypatch):
    assert "There is no me/nothing on http://127" in refused("pull", "me/nothing", capsys=capsys)
    assert "give OWNER/NAME" in refused("pull", "a/b/c", capsys=capsys)
    main(["policies", "push", "fast", "me/fast"])
    said = refused("pull", "me/fast", "--revision", "v9", capsys=capsys)
    assert "no such branch, tag or commit" in said
    monkeypatch.setenv("HF_TOKEN", "hf_wrong")
    assert "hf auth login" in refused("push", "fast", "me/mine", capsys=capsys)
    monkeypatch.setattr("huggingface_hub.constants.ENDPOINT", "http://127.0.0.1:1")
    assert "Could not use" in refused("pull", "me/fast", capsys=capsys)
