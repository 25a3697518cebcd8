"""Training ledgers of `client/learn/python/ledger.py`."""

import importlib.util
from pathlib import Path

import pytest

PATH = Path(__file__).parents[3] / "client/learn/python/ledger.py"
SPEC = importlib.util.spec_from_file_location("training_ledger", PATH)
assert SPEC and SPEC.loader
ledger = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(ledger)


def episode(seed: int, sentence: str) -> dict:
    return {
        "format": ledger.FORMAT, "seeds": [[seed, seed]], "appearance_seeds": [], "specimens": [], "homes": ["home"],
        "objects": ["mustard"], "sentences": [ledger.sentence(sentence)],
    }  # fmt: skip


def test_sentence_has_the_hash_of_the_rust_module():
    # `spelling_of_a_sentence_does_not_hide_an_overlap` in client/policy/src/ledger.rs.
    assert ledger.sentence("Take the mustard, please!") == "f35ab74f0527182e"
    assert ledger.sentence("take  the Mustard please") == "f35ab74f0527182e"


def test_merged_ledger_has_the_content_of_all_episodes():
    merged = ledger.merge([episode(5, "a"), episode(7, "b"), episode(6, "A.")])
    assert merged["seeds"] == [[5, 7]]
    assert merged["homes"] == ["home"] and len(merged["sentences"]) == 2


def test_unknown_content_makes_a_kind_undeclared():
    merged = ledger.merge([episode(5, "a"), ledger.from_seeds([9, 8])])
    assert merged["seeds"] == [[5, 5], [8, 9]]
    assert "sentences" not in merged and "homes" not in merged
    assert ledger.merge([episode(5, "a"), None]) == {"format": ledger.FORMAT}


def test_ledger_is_beside_its_policy_and_bound_to_it(tmp_path):
    policy = tmp_path / "p.safetensors"
    assert ledger.read(policy) is None
    ledger.write(policy, episode(5, "a"), "ab12")
    found = ledger.read(policy)
    assert found == {**episode(5, "a"), "policy": "ab12"}
    more = ledger.with_sentences(found, ["b"])
    assert len(more["sentences"]) == 2
    ledger.write(policy, None, "")
    assert ledger.read(policy) is None
    ledger.path_of(policy).write_text("{")
    with pytest.raises(ValueError, match=r"p\.ledger\.json"):
        ledger.read(policy)
