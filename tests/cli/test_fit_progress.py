import time

from hopping_leg.cli.fit_progress import FitProgress


def test_without_a_terminal_there_is_a_line_a_minute(monkeypatch, capsys):
    clock = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    with FitProgress() as progress:
        for second in range(0, 181, 20):
            clock[0] = float(second)
            progress.update("cma", max(second, 1) / 400, 1234.5)
    lines = capsys.readouterr().err.strip().splitlines()
    assert [line.split(" · ")[0] for line in lines] == ["cma 15 %", "cma 30 %", "cma 45 %"]
    assert lines[0] == "cma 15 % · cost 1234.5 · at most 5:40 left"
