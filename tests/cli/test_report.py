import json

from hopping_leg.cli import main
from tests.evaluate.test_comparison import TRAINING


def test_trainings_beside_each_other(tmp_path, capsys):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "result.json").write_text(json.dumps(TRAINING))
    page, numbers = tmp_path / "page.html", tmp_path / "numbers.json"
    runs = [str(tmp_path / "one"), str(tmp_path / "two")]
    assert main(["report", "page", *runs, "--out", str(page), "--json", str(numbers)]) == 0
    assert "Learning curves" in page.read_text()
    found = json.loads(numbers.read_text())
    assert [row["label"] for row in found["trainings"]] == ["one", "two"]
    assert found["trainings"][0]["curve"][1]["score_m"] == 0.005
    assert str(page) in capsys.readouterr().out


def test_bad_input_is_one_sentence(tmp_path, refused):
    trace = str(tmp_path / "none.parquet")
    pages = ([], ["none", "nothing"], ["a", "b", "--out", str(tmp_path)])
    for words in (["figures"], ["figures", trace], *(["page", *page] for page in pages)):
        refused(["report", *words], "")
