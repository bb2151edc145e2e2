"""The estimate of a car from its recordings, in words and as conditions of the simulator."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallride.runtime.calibration.responses import Estimate
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.fit.drive import RecordedDrive, join, read_drive
from wallride.sim.fit.driving import DriveFit, fit_drive
from wallride.sim.fit.sensor import SensorFit, fit_sensor
from wallride.sim.fit.steering import SteeringFit, fit_steering
from wallride.sim.recordings import load_recording

MIN_PART_SHARE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class CarEstimate:
    """names: of the recordings. drive: all of them, joined."""

    names: tuple[str, ...]
    drive: RecordedDrive
    steering: SteeringFit
    driving: DriveFit
    sensor: SensorFit


@dataclass(frozen=True, slots=True)
class Row:
    """One parameter. key: of the conditions, "" where they have none. value: as TOML, "" where not identified."""

    name: str
    text: str
    key: str = ""
    value: str = ""


def estimate(paths: Sequence[Path], wheelbase_m: float, topic: str | None = None) -> CarEstimate:
    """Return the estimate from recordings of one car; RecordingError for an unreadable one."""
    recordings = [load_recording(path, topic) for path in paths]
    drives = [read_drive(recording) for recording in recordings]
    drive = join(drives)
    assumed = VehicleSettings()
    steering = fit_steering(drive, wheelbase_m, (assumed.steering_delay_s, assumed.steering_rate_radps))
    farthest = int(np.argmax([one.moved_m for one in drives]))
    sensor = fit_sensor(recordings[farthest], drives[farthest].moved_m)
    names = tuple(recording.name for recording in recordings)
    return CarEstimate(names, drive, steering, fit_drive(drive), sensor)


def rows(found: CarEstimate) -> Iterator[Row]:
    """Yield the parameters in the order of the table."""
    steering, driving, sensor = found.steering, found.driving, found.sensor
    yield _row("steering delay", steering.delay_s, "s", "vehicle.steering_delay_s")
    yield _row("steering rate", steering.rate_radps, "rad/s", "vehicle.steering_rate_radps")
    yield _row("trim", steering.trim_rad, "rad", "vehicle.trim_rad")
    yield _row("wheelbase / steering gain", steering.wheelbase_m, "m", "vehicle.wheelbase_m")
    yield _row("motor delay", driving.delay_s, "s", "vehicle.drive_delay_s")
    yield _row("motor ramp", driving.ramp_mps2, "m/s2", "vehicle.ramp_mps2")
    yield _row("speed by the scans over the reported", driving.speed_gain, "(too low in a bare corridor)")
    yield Row("friction", f"at least {driving.used_mu:.2f}; only a skid shows more")
    if np.isfinite(sensor.noise_std_m):
        text = f"{1e3 * sensor.noise_std_m:.1f} mm"
        yield Row("noise of a range", text, "lidar.noise_std_m", f"{sensor.noise_std_m:.4f}")
        yield Row("outliers", f"{sensor.outlier_share:.2%}", "lidar.outlier_share", f"{sensor.outlier_share:.5f}")
        yield Row("lost beams", f"{sensor.dropout_share:.2%}", "lidar.dropout_share", f"{sensor.dropout_share:.5f}")
    yield _parts(sensor)


def _row(name: str, found: Estimate, unit: str, key: str = "") -> Row:
    return Row(name, found.as_text(unit), key, "" if found.why or not key else f"{found.value:.4f}")


def _parts(sensor: SensorFit) -> Row:
    if sensor.why:
        return Row("own parts", f"not identified: {sensor.why}")
    places = ", ".join(f"{first:.0f} to {last:.0f} deg at {m:.2f} m" for first, last, m in sensor.parts) or "none"
    if sensor.parts and sensor.part_share < MIN_PART_SHARE:
        return Row("own parts", f"{places}; no kind of the simulator is like them")
    like = f"; most like {sensor.part_kind} ({sensor.part_share:.0%} of the beams)" if sensor.parts else ""
    return Row("own parts", places + like, "lidar.own_parts", f'"{sensor.part_kind}"')


def distance(found: CarEstimate) -> str:
    """Return in a sentence how far the simulator's own car is from this one, and how far it is with the estimate."""
    steering = found.steering
    if not np.isfinite(steering.rms_rad):
        return "The recordings do not tell how far the simulator is from this car: the steering hardly moved."
    return (
        f"The wheels' angle that the scans show differs from the simulator's by {steering.assumed_rms_rad:.3f} rad"
        f" (rms) with its own delay and rate, and by {steering.rms_rad:.3f} rad with these."
    )


def conditions_text(found: CarEstimate) -> str:
    """Return the identified parameters as a conditions file for `wallride sim --conditions`."""
    lines = [f"# Estimated by `wallride lab fit` from {', '.join(found.names)}; speed by {found.drive.origin}."]
    known = [row for row in rows(found) if row.key and row.value]
    for section in ("vehicle", "lidar"):
        of = [row for row in known if row.key.startswith(f"{section}.")]
        if of:
            lines += ["", f"[{section}]"]
            lines += [f"{row.key.partition('.')[2]} = {row.value}  # {row.text}" for row in of]
    lines += ["", *(f"# {row.name}: {row.text}" for row in rows(found) if not row.value)]
    return "\n".join(lines) + "\n"
