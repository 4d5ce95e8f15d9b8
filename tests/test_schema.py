import math
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import pytest

from vsensor.errors import ConfigError
from vsensor.schema import Config, check_schema, convert, read_toml, user_path


class Wheel(Config, frozen=True, kw_only=True):
    radius_m: Annotated[float, msgspec.Meta(ge=0.1, le=2.0)] = 0.3


class Car(Config, frozen=True, kw_only=True):
    name: str
    height_m: float = 1.5
    wheel: Wheel = Wheel()
    spares: tuple[Wheel, ...] = ()
    by_place: dict[str, Wheel] = msgspec.field(default_factory=dict)
    trailer: Wheel | None = None
    colour: Literal["red", "blue"] = "red"


def refused(data):
    with pytest.raises(ConfigError) as caught:
        convert(data, Car, "car.toml")
    message = str(caught.value)
    assert message.startswith("car.toml: ")
    assert "\n" not in message
    return message.removeprefix("car.toml: ")


def test_a_good_table_is_converted_with_its_defaults():
    car = convert({"name": "a", "wheel": {"radius_m": 0.4}, "spares": [{}]}, Car, "car.toml")
    assert car == Car(name="a", height_m=1.5, wheel=Wheel(radius_m=0.4), spares=(Wheel(radius_m=0.3),))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"heigth_m": 1.0}, "heigth_m: unknown key; did you mean height_m?"),
        ({"wheel": {"radius_cm": 1}}, "wheel.radius_cm: unknown key; did you mean radius_m?"),
        ({"spares": [{}, {"radius": 1}]}, "radius: unknown key; did you mean radius_m?"),
        (
            {"by_place": {"right": {}, "left": {"radios_m": 1}}},
            "by_place.left.radios_m: unknown key; did you mean radius_m?",
        ),
        ({"trailer": {"radios_m": 1}}, "trailer.radios_m: unknown key; did you mean radius_m?"),
        ({"wheel": {"zzz": 1}}, "wheel.zzz: unknown key; known keys: radius_m"),
    ],
)
def test_an_unknown_key_is_refused_and_the_nearest_known_one_named(data, message):
    assert refused({"name": "a"} | data).endswith(message)


@pytest.mark.parametrize(
    ("data", "key", "value", "expected"),
    [
        ({"wheel": {"radius_m": 30}}, "wheel.radius_m", "30", "<= 2.0"),
        ({"wheel": {"radius_m": 0.01}}, "wheel.radius_m", "0.01", ">= 0.1"),
        ({"spares": [{}, {"radius_m": 9.0}]}, "spares[1].radius_m", "9.0", "<= 2.0"),
        ({"by_place": {"right": {}, "left": {"radius_m": 9}}}, "by_place.left.radius_m", "9", "<= 2.0"),
        ({"colour": "blew"}, "colour", "'blew'", "blue, red were expected"),
        ({"height_m": "1.5"}, "height_m", "'1.5'", "expected `float`"),
        ({"wheel": 3}, "wheel", "3", "expected `object`"),
    ],
)
def test_a_value_out_of_range_or_of_the_wrong_type_is_refused_with_key_value_and_expectation(
    data, key, value, expected
):
    message = refused({"name": "a"} | data)
    assert message.startswith(f"{key} = {value}: ")
    assert expected in message


def test_a_missing_key_is_named():
    assert "name" in refused({})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("nest", "path"),
    [
        (lambda v: {"height_m": v}, "height_m"),
        (lambda v: {"wheel": {"radius_m": v}}, "wheel.radius_m"),
        (lambda v: {"spares": [{}, {"radius_m": v}]}, "spares[1].radius_m"),
    ],
)
def test_a_number_that_is_not_finite_is_refused_with_its_key(value, nest, path):
    assert refused({"name": "a"} | nest(value)) == f"{path} = {value}: a finite number was expected"


@pytest.mark.parametrize("found", ["vsensor.scenario/1", "vsensor.scenario/2", "vsensor.scenario/3"])
def test_this_and_every_older_version_of_a_schema_is_read(found):
    data = {"schema": found, "a": 1}
    assert check_schema(data, "vsensor.scenario/3", "f.toml") == {"a": 1}
    assert data == {"schema": found, "a": 1}


@pytest.mark.parametrize("found", ["vsensor.scenario/4", "vsensor.scenario/0", "vsensor.scenario/10"])
def test_a_newer_version_or_version_0_is_refused(found):
    with pytest.raises(ConfigError, match=r"f\.toml: schema .* reads up to 'vsensor\.scenario/3'"):
        check_schema({"schema": found}, "vsensor.scenario/3", "f.toml")


@pytest.mark.parametrize(
    "found",
    [None, 3, "", "vsensor.profile/1", "vsensor.scenario", "vsensorXscenario/1", "vsensor.scenario/1 "],
)
def test_a_missing_or_foreign_schema_is_refused_saying_which_was_expected(found):
    data = {} if found is None else {"schema": found}
    with pytest.raises(ConfigError, match=r'f\.toml: schema is .*expected schema = "vsensor\.scenario/3"'):
        check_schema(data, "vsensor.scenario/3", "f.toml")


def test_toml_is_read(tmp_path):
    (tmp_path / "a.toml").write_text("height_m = 1.5 # µ", encoding="utf-8")
    assert read_toml(tmp_path / "a.toml") == {"height_m": 1.5}


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"a = 1\nb = \n", "not TOML: .*line 2"),
        (b"a = 1\na = 2\n", "not TOML"),
        (b"\xff\xfe", "line 1: not UTF-8"),
        ("a = 1\nb = 'Straße'\n".encode("latin-1"), "line 2: not UTF-8"),
        (b"a = " + 5000 * b"[", "not TOML: .*nested"),
        (None, "no such file"),
    ],
)
def test_a_file_that_is_not_toml_is_refused_by_name_and_place(tmp_path, content, expected):
    if content is not None:
        (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(ConfigError, match=rf"a\.toml: {expected}"):
        read_toml(tmp_path / "a.toml")


@pytest.mark.parametrize("content", [b"\xef\xbb\xbfa = 1\n", b"a = 1\r\n"])
def test_a_file_of_a_windows_editor_is_read(tmp_path, content):
    (tmp_path / "a.toml").write_bytes(content)
    assert read_toml(tmp_path / "a.toml") == {"a": 1}


def test_a_name_that_no_file_can_have_is_refused():
    with pytest.raises(ConfigError, match="cannot be read"):
        read_toml(Path("a\0.toml"))


def test_the_home_folder_of_nobody_is_a_name_like_any_other():
    assert user_path("~nobody-has-this-name/a.toml") == Path("~nobody-has-this-name/a.toml")
    assert user_path("~/a.toml") == Path.home() / "a.toml"


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="is a folder"):
        read_toml(tmp_path)
