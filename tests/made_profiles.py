"""Profiles and databases that tests write, and frames through them."""

import cantools

from tests.bus_values import AVAILABLE, ego, estimate, four_lines, slot
from vsensor.profile import load_profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.transmit import Transmitter, initial_state, transmit

VEHICLE = VehicleConfig()
HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: CAM ECU OTHER\n'


def written(tmp_path, dbc, toml, name="mine"):
    """Write a database and a profile for it; return the profile's path."""
    (tmp_path / f"{name}.dbc").write_text(HEAD + dbc)
    path = tmp_path / f"{name}.toml"
    path.write_text(f'schema = "vsensor.profile/1"\ndatabase = "{name}.dbc"\n' + toml)
    return path


def profile_of(tmp_path, dbc, toml, name="mine"):
    return load_profile(written(tmp_path, dbc, toml, name))


def reference(profile):
    """Return cantools' own reading of a profile's database."""
    return cantools.database.load_file(profile.database, strict=False)


def values(lines=None, mode=AVAILABLE, **motion):
    return values_from(VEHICLE, four_lines() if lines is None else lines, ego(**motion), mode)


def nothing(mode=AVAILABLE):
    return values(estimate(), mode)


class Sender:
    """Sends slot after slot, keeping the state."""

    def __init__(self, profile, vehicle=VEHICLE, camera_x_m=None):
        self.transmitter = Transmitter(profile, vehicle, camera_x_m)
        self.state, self.index = initial_state(self.transmitter), 0

    def __call__(self, found):
        self.state, frames = transmit(self.transmitter, self.state, found, slot(self.index))
        self.index += 1
        return frames


def sent(profile, found, camera_x_m=None):
    """Return the frames of the first slot."""
    return Sender(profile, camera_x_m=camera_x_m)(found)


def raws(profile, frames):
    """Return what cantools reads, unscaled: one dict for each frame."""
    database = reference(profile)
    return [
        database.decode_message(frame.arbitration_id, frame.data, decode_choices=False, scaling=False)
        for frame in frames
    ]
