"""From a database to the text of a profile that loads."""

import os
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vsensor.codec import Database, excess_range, load_database
from vsensor.errors import ConfigError, VsensorError
from vsensor.profile import SCHEMA, ProfileConfig, compile_profile, hint
from vsensor.profile_new.draft import Draft, Entry, draft_of
from vsensor.profile_new.geometry import geometry_of
from vsensor.profile_new.skeleton import Skeleton, skeleton_of
from vsensor.profile_new.write import profile_text
from vsensor.schema import check_schema, convert
from vsensor.signals import VehicleConfig
from vsensor.transmit import Transmitter

_CYCLE_MS = 40.0
_CAMERA_X_M = 1.9
_SENSOR_PARTS = ("lane.", "image.", "sensor.")
_SHAPE = ("offset_m", "lane_offset_m", "heading", "curvature_per_m", "c2_per_m")
_MOST_MESSAGES = 20


def new_profile(
    file: Path, out: Path | None = None, node: str | None = None, role: str | None = None
) -> Skeleton:
    """Return a profile for a database as text: what is guessed loads, what is uncertain is marked.

    `out`: where it will stand, for the path to the database; `node`: only what this sender sends; `role`:
    "sensor" or "vehicle", else what the database seems to be of. Raises DbcError, or ConfigError for an
    unknown node and for a database without a lane or motion signal.
    """
    database = load_database(file)
    folder = Path.cwd() if out is None else out.absolute().parent
    drafts = _drafts(database, node)
    _join_polynomials(drafts)
    role = role or _role_of(drafts)
    drafts = _chosen(drafts, role, str(database.path))
    relative = Path(os.path.relpath(file.absolute(), folder)).as_posix()
    title = (
        f"{database.path.stem}: lanes" if role == "sensor" else f"{database.path.stem}: motion of the vehicle"
    )
    while True:
        text = profile_text(
            drafts,
            geometry_of(drafts) if role == "sensor" else [],
            title=title,
            database=relative,
            role=role,
            node=node if role == "sensor" else None,
            saturate=role == "sensor" and _saturates(drafts),
            cycle_ms=_CYCLE_MS,
        )
        problem = _problem(text, file, database)
        if not problem:
            return skeleton_of(text, drafts, role, out)
        if not _give_up(drafts, problem):
            raise ConfigError(f"{database.path}: no profile that loads could be guessed: {problem}")


def _drafts(database: Database, node: str | None) -> list[Draft]:
    """Return what is guessed of every message, or of those that a node sends, by their ids."""
    senders = {sender for layout in database.layouts.values() for sender in layout.senders}
    if node is not None and node not in senders:
        raise ConfigError(f"{database.path}: node {node!r} sends no message{hint(node, senders)}")
    layouts = [x for x in database.layouts.values() if node is None or node in x.senders]
    return [draft_of(layout) for layout in sorted(layouts, key=lambda x: (x.is_extended, x.arbitration_id))]


def _role_of(drafts: Sequence[Draft]) -> str:
    """Return "sensor" if a line is told or nothing of the vehicle is, else "vehicle"."""
    return "sensor" if any(map(_tells_lane, drafts)) or not any(map(_is_motion, drafts)) else "vehicle"


def _chosen(drafts: Sequence[Draft], role: str, where: str) -> list[Draft]:
    """Return the messages that a profile of this role could be about, each quantity told once."""
    if role == "vehicle":
        _seen_by_vehicle(drafts)
        _tell_once(drafts)
        moving = [draft for draft in drafts if _is_motion(draft)]
        if not moving:
            raise ConfigError(
                f"{where}: none of {len(drafts)} messages has motion of the vehicle by its name"
            )
        _close(moving)
        return moving
    lanes = [draft for draft in drafts if _is_lane(draft)]
    if not lanes and (len(drafts) > _MOST_MESSAGES or not drafts):
        raise ConfigError(
            f"{where}: none of {len(drafts)} messages has a lane or motion by its name; "
            "give the camera's --node, or write the profile by hand"
        )
    nodes = {sender for draft in lanes for sender in draft.layout.senders}
    found = [d for d in drafts if not lanes or d in lanes or (nodes & set(d.layout.senders) and _belongs(d))]
    _tell_once(found)
    return found


def _is_motion(draft: Draft) -> bool:
    return any(guess.role == "quantity" and guess.what.startswith("ego.") for guess in draft.guesses)


def _tells_lane(draft: Draft) -> bool:
    return any(guess.of_line or guess.what.startswith("lane.") for guess in draft.guesses)


def _is_lane(draft: Draft) -> bool:
    """Return whether a message describes lines: one that is known, or the shape of one that is not."""
    for entry in draft.entries:
        guess = entry.guess
        if guess is None or guess.role != "quantity":
            continue
        if guess.what in _SHAPE or (entry.said and (guess.of_line or guess.what.startswith("lane."))):
            return True
    return False


def _seen_by_vehicle(drafts: Sequence[Draft]) -> None:
    """Read the light as the vehicle's own, and nothing that only a sensor has."""
    for entry in (entry for draft in drafts for entry in draft.entries if entry.said is not None):
        if entry.said and entry.said.get("quantity") == "sensor.light":
            entry.said["quantity"] = "ego.light"
        elif entry.guess is not None and entry.guess.what.startswith(_SENSOR_PARTS):
            entry.said = None


def _belongs(draft: Draft) -> bool:
    return any(guess.what.startswith((*_SENSOR_PARTS, "ego.")) for guess in draft.guesses)


def _tell_once(drafts: Sequence[Draft]) -> None:
    """Leave a number of a line to the first signal that seems to carry it; tables may share."""
    seen: dict[str, str] = {}
    for draft in drafts:
        for entry in draft.entries:
            guess = entry.guess
            if entry.said is None or guess is None or guess.role != "quantity" or entry.signal.mux_signal:
                continue
            if "table" in entry.said or "wrap" in entry.said:
                continue
            name = f"{draft.layout.name}.{entry.signal.name}"
            first = seen.setdefault(guess.quantity, name)
            if first != name:
                _open(entry, f"{guess.quantity}? {first} has it already")


def _close(drafts: Sequence[Draft]) -> None:
    """Leave no question at what nobody has to listen to."""
    for entry in (entry for draft in drafts for entry in draft.entries if entry.said is None):
        entry.why_not, entry.doubt = entry.why_not or entry.doubt, ""


def _join_polynomials(drafts: Sequence[Draft]) -> None:
    """Take the distance to an inner edge as the offset of the line's polynomial where it has no other."""
    entries = [e for d in drafts for e in d.entries if e.said and e.guess and e.guess.role == "quantity"]
    told: dict[str, set[str]] = {}
    for entry in entries:
        if entry.guess is not None:
            told.setdefault(entry.guess.line, set()).add(entry.guess.what)
    for entry in entries:
        guess = entry.guess
        if guess is None or entry.said is None or guess.what != "lane_offset_m":
            continue
        if "offset_m" not in told[guess.line] and told[guess.line] & {
            "heading",
            "curvature_per_m",
            "c2_per_m",
        }:
            entry.guess = replace(guess, what="offset_m")
            entry.said["quantity"] = entry.guess.quantity


def _open(entry: Entry, reason: str) -> None:
    entry.said, entry.doubt = None, reason


def _saturates(drafts: Sequence[Draft]) -> bool:
    return any(
        entry.said is not None and excess_range(entry.signal, 1.0 + 1e-9)
        for d in drafts
        for entry in d.entries
    )


def _problem(text: str, file: Path, database: Database) -> str:
    """Return why the text is no profile that can be sent, "" if it is."""
    where = str(file)
    try:
        config = convert(check_schema(tomllib.loads(text), SCHEMA, where), ProfileConfig, where)
        profile = compile_profile(Path(where), config, database)
        if profile.role == "sensor":
            Transmitter(profile, VehicleConfig(), _CAMERA_X_M)
    except VsensorError as error:
        return str(error).removeprefix(f"{where}: ")
    return ""


def _give_up(drafts: Sequence[Draft], problem: str) -> bool:
    """Turn the line that a problem is about into an open place; False if none is."""
    for draft in drafts:
        name = draft.layout.name
        if not problem.startswith((f"{name}.", f"{name}:", f"{name} ", f"messages.{name}")):
            continue
        standing = [entry for entry in draft.entries if entry.said is not None]
        about = [e for e in standing if problem.startswith(f"{name}.{e.signal.name}:")]
        about = about or [e for e in standing if e.signal.name in problem.split(": ", 1)[-1].split()]
        if about:
            _open(about[-1], f"{about[-1].said}: {problem}")
            return True
        if draft.e2e:
            draft.e2e, draft.e2e_doubt = {}, f"{draft.e2e}: {problem}"
            return True
    return False
