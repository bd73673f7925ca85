"""The file of a whole search: a database, so that a period changes only what belongs to its group, and
whoever is killed while saving leaves the state before."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from .. import _aplanat
from ..lens import Lens
from .coordinator import Coordinator, Group

FORMAT = 2
TABLES = """
    CREATE TABLE IF NOT EXISTS search (name TEXT PRIMARY KEY, content TEXT);
    CREATE TABLE IF NOT EXISTS chains (number INTEGER PRIMARY KEY, content TEXT, state BLOB);
"""


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(path, timeout=60)) as database:
        yield database


def save(search: Coordinator, path: str | os.PathLike[str]) -> None:
    """Saves the groups that have changed. If it fails, with `OSError`, the file is as it was."""
    head = {"format": FORMAT, **_settings(search)}
    groups = [(i, _content(search._groups[i]), search._groups[i].state) for i in search.unsaved]
    try:
        with _opened(Path(path)) as database, database:
            database.executescript(TABLES)
            rows = [(name, json.dumps(content)) for name, content in head.items()]
            database.executemany("INSERT OR IGNORE INTO search VALUES (?, ?)", rows)
            database.executemany("INSERT OR REPLACE INTO chains VALUES (?, ?, ?)", groups)
    except sqlite3.Error as error:
        raise OSError(f"{path}: {error}") from error
    search.unsaved.clear()


def load(path: str | os.PathLike[str]) -> Coordinator:
    """The search of a file."""
    try:
        with _opened(Path(path)) as database:
            head = {name: json.loads(text) for name, text in database.execute("SELECT * FROM search")}
            rows = list(database.execute("SELECT content, state FROM chains ORDER BY number"))
        if head.pop("format") != FORMAT:
            raise _aplanat.InputError(f"{path}: of another version of Aplanat")
        search = Coordinator(Lens(head.pop("lens")), **head)
        if len(rows) != search.groups:
            raise _aplanat.InputError(f"{path}: {len(rows)} groups; expected {search.groups}")
        search._groups = [_group(json.loads(content), state) for content, state in rows]
    except (KeyError, TypeError, ValueError, sqlite3.Error) as error:
        if isinstance(error, _aplanat.InputError):
            raise
        raise _aplanat.InputError(f"{path}: not a search of aplanat.ray: {error!r}") from None
    search.unsaved.clear()
    return search


def resume(search: Coordinator, path: str | os.PathLike[str] | None) -> Coordinator:
    """The search of a file if there is one, which must be this search; else this search."""
    if path is None or not Path(path).exists() or Path(path).stat().st_size == 0:
        return search
    found = load(path)
    expected, own = _settings(search), _settings(found)
    for name, content in expected.items():
        if own[name] != content:
            raise _aplanat.InputError(f"{path}: of a search with another value of `{name}`")
    return found


def _settings(search: Coordinator) -> dict[str, Any]:
    """Everything that the result depends on, as JSON has it."""
    settings = {
        "lens": search.lens.data,
        "plan": dict(search.plan),
        "gradients": search.gradients,
        "groups": search.groups,
        "period": search.period,
    }
    return json.loads(json.dumps(settings))


def _content(group: Group) -> str:
    content = {name: value for name, value in vars(group).items() if name not in ("state", "digest")}
    return json.dumps(content)


def _group(content: dict[str, Any], state: bytes | None) -> Group:
    best = {int(number): tuple(entry) for number, entry in content.pop("best").items()}
    merits, lenses = (tuple(content.pop(name)) for name in ("merits", "lenses"))
    digest = b"" if state is None else hashlib.sha256(state).digest()
    return Group(**content, merits=merits, lenses=lenses, best=best, state=state, digest=digest)
