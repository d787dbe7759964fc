from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.ledger import Ledger, read_ledger
from unilavira_drake.mllm.reply import Attempt, Usage
from unilavira_drake.mllm.request import MllmRequest

REQUEST = MllmRequest(role="vision", n=3, attempt=1, call="ground")
ATTEMPT = Attempt(
    "qwen", "MllmQuotaError", 429, Usage(900, 120, 4, None, 600, 100), 1.5, "later \ud800"
)
COLUMNS = (
    "role call n attempt try model status http_status input_tokens cached_tokens output_tokens "
    "reasoning_tokens images latency_s cost_usd detail"
)


def test_a_row_is_one_line_with_its_public_names(tmp_path: Path) -> None:
    path = tmp_path / "ledger.jsonl"
    ledger = Ledger(path)
    ledger.record(REQUEST, 2, ATTEMPT)
    # Live: nothing waits for the end of the run.
    (line,) = path.read_text().splitlines()
    row = json.loads(line)
    assert list(row) == COLUMNS.split()
    assert (row["role"], row["call"], row["n"], row["attempt"], row["try"]) == (
        "vision", "ground", 3, 1, 2,
    )  # fmt: skip
    assert (row["output_tokens"], row["reasoning_tokens"]) == (20, 100)
    assert row["cost_usd"] is None
    ledger.close()
    ledger.record(REQUEST, 3, ATTEMPT)
    assert len(path.read_text().splitlines()) == 1


def test_rows_come_back_and_a_torn_last_one_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "ledger.jsonl"
    ledger = Ledger(path)
    for tries in (1, 2):
        ledger.record(REQUEST, tries, ATTEMPT)
    ledger.close()
    with path.open("a") as stream:
        stream.write('{"role": "langu')
    rows = read_ledger(path)
    assert [row.try_ for row in rows] == [1, 2]
    assert rows[0].status == "MllmQuotaError"
    assert rows[0].latency_s == 1.5


def test_rows_of_many_threads_stay_whole(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "ledger.jsonl")

    def write() -> None:
        for tries in range(50):
            ledger.record(REQUEST, tries, ATTEMPT)

    threads = [threading.Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    ledger.close()
    assert len(read_ledger(tmp_path / "ledger.jsonl")) == 200


@pytest.mark.parametrize("text", ["no json\n", "[]\n", '{"role": "language"}\n', "3\n"])
def test_another_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "notes.txt"
    path.write_text(text)
    with pytest.raises(InputError, match="line 1"):
        read_ledger(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_ledger(tmp_path / "none.jsonl")
