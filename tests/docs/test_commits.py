"""Commits say what they do in a short imperative subject, and why in the body."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SUBJECTS_SINCE = "54e335b"
BODIES_FROM = "2026-11-23"
"""Commits written from this day on have a body; half of the older ones have none, and history is not rewritten."""
MAX_SUBJECT = 72
NOT_VERBS = {"A", "An", "The", "This", "New", "Some", "More", "No", "Now", "Fixes", "Adds"}
LIKE_PARTICIPLES = {"Bring", "Feed", "Need", "Seed", "Speed", "Embed", "String"}


def faults(subject, body, *, needs_body):
    """Return what is wrong with a commit's message."""
    wrong = []
    if len(subject) > MAX_SUBJECT:
        wrong.append(f"{len(subject)} characters in the subject, at most {MAX_SUBJECT}")
    if subject.endswith("."):
        wrong.append("a period after the subject")
    verb = re.match(r"[A-Z][a-z]+(?:-[a-z]+)?(?=,? )", subject)
    if verb is None or verb[0] in NOT_VERBS:
        wrong.append("the subject does not begin with a capital verb")
    elif verb[0].endswith(("ed", "ing")) and verb[0] not in LIKE_PARTICIPLES:
        wrong.append("the subject's verb is not imperative")
    if needs_body and not body.strip():
        wrong.append("no body: the reason is missing")
    return wrong


def history(since):
    """Return (hash, day, subject, body) of every commit since one; None where this is no clone that has it."""
    log = ["git", "log", "--no-merges", "--format=%h%x1f%as%x1f%s%x1f%b%x1e", f"{since}..HEAD"]
    try:
        found = subprocess.run(log, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return None
    return [tuple(entry.strip("\n").split("\x1f")) for entry in found.split("\x1e") if entry.strip()]


def test_subjects_and_bodies_of_the_commits():
    commits = history(SUBJECTS_SINCE)
    if commits is None:
        pytest.skip(f"no git history down to {SUBJECTS_SINCE} here: clone the repository in full to check its commits")
    wrong = {
        f"{commit} {subject}": found
        for commit, day, subject, body in commits
        if (found := faults(subject, body, needs_body=day >= BODIES_FROM))
    }
    assert wrong == {}


@pytest.mark.parametrize(
    ("subject", "body", "found"),
    [
        ("Keep the distance from rough walls", "The car drove 16 mm too near.", 0),
        ("Bring tests to where their rooms are", "Because.", 0),
        ("Keep the distance from rough walls", "", 1),
        ("Keep the distance from rough walls.", "Because.", 1),
        ("Keep " + "x" * 68, "Because.", 1),
        ("keep the distance", "Because.", 1),
        ("Fixed the distance", "Because.", 1),
        ("Fixing the distance", "Because.", 1),
        ("The distance is kept", "Because.", 1),
    ],
)
def test_faults(subject, body, found):
    assert len(faults(subject, body, needs_body=True)) == found
