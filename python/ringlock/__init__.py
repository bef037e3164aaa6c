"""ringlock: lock-in of mechanically dithered ring laser gyros.

Simulates ensembles of gyros and compares cures of the lock-in error (`run`), computes deviations of the Allan family
with intervals and noise coefficients (`allan`), and finds the error sources in measured records (`close`). Results of
the program `ringlock` are read with `read`. Names of quantities carry their unit: rate_deg_h, tau_s.

Wrong input raises InputError, a ValueError; a run that fails raises RunError, a RuntimeError. Ctrl-C ends a run or a
closed loop with KeyboardInterrupt.
"""

import json as _json
import math as _math
import os as _os

import numpy as _np

from . import _ringlock
from ._ringlock import Arm, Figure, InputError, Interrupted, MeanFigure, Progress, RunError, Theory

for _class in (Arm, Figure, InputError, Interrupted, MeanFigure, Progress, RunError, Theory):
    _class.__module__ = __name__
del _class

__version__ = _ringlock.version
git_hash = _ringlock.git_hash

__all__ = [
    "AngleRecord",
    "Arm",
    "Closure",
    "Device",
    "Figure",
    "InputError",
    "Interrupted",
    "MeanFigure",
    "Progress",
    "Record",
    "Result",
    "RunError",
    "Scenario",
    "Theory",
    "allan",
    "close",
    "devices",
    "git_hash",
    "read",
    "run",
    "simulate_record",
]


def devices():
    """Names of the gyros that a scenario can take: values of its key "device"."""
    return list(_ringlock.known_devices())


# --- Scenarios -------------------------------------------------------------------------------------------------------


def _plain(value):
    """Numbers and lists of NumPy as those of Python."""
    if isinstance(value, (_np.ndarray, _np.generic)):
        return value.tolist()
    if isinstance(value, tuple):
        return list(value)
    return value


def _setting_value(key, value):
    value = _plain(value)
    if isinstance(value, _os.PathLike):
        value = _os.fspath(value)
    if isinstance(value, list):
        if all(isinstance(v, str) for v in value) and value:
            return value
        if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value):
            return [float(v) for v in value]
    elif isinstance(value, (bool, int, float, str)):
        return value
    raise InputError(f'key "{key}": a value is a number, a boolean, a string or a list of numbers or strings, '
                     f"not {type(value).__name__}")


def _toml_value(key, value):
    value = _setting_value(key, value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        if _math.isnan(value) or _math.isinf(value):
            return repr(value)
        text = repr(value)
        return text if any(c in text for c in ".en") else text + ".0"
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(key, v) for v in value) + "]"
    return _json.dumps(value)


def _is_tables(value):
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(isinstance(v, dict) for v in value)


def _nested(scenario):
    """A dict whose keys may be paths, "gyro.scale_factor_arcsec", as tables in tables."""
    out = {}
    for key, value in scenario.items():
        if not isinstance(key, str):
            raise InputError(f"a key of a scenario is a string, not {key!r}")
        value = _nested(value) if isinstance(value, dict) else value
        *path, name = key.split(".")
        table = out
        for part in path:
            table = table.setdefault(part, {})
        if isinstance(value, dict) and isinstance(table.get(name), dict):
            table[name].update(value)
        else:
            table[name] = value
    return out


def _toml_tables(table, path):
    lines = []
    for key, value in table.items():
        full = f"{path}.{key}" if path else key
        if not isinstance(value, dict) and not _is_tables(value):
            lines.append(f"{_json.dumps(key)} = {_toml_value(full, value)}")
    for key, value in table.items():
        full = f"{path}.{key}" if path else key
        name = ".".join(_json.dumps(part) for part in full.split("."))
        if isinstance(value, dict):
            lines += [f"[{name}]"] + _toml_tables(value, full)
        elif _is_tables(value):
            for one in value:
                lines += [f"[[{name}]]"] + _toml_tables(one, full)
    return lines


def _settings(settings):
    return [_ringlock.Setting(key, _setting_value(key, value)) for key, value in (settings or {}).items()]


class Device:
    """Constants of a gyro of one's own, for Scenario.use().

    source: path of a TOML file with sections [gyro] and [dither], as scenarios/devices has them, or a dict of the same
    keys: {"gyro.scale_factor_arcsec": 1.2, "dither": {"frequency_hz": 400}}.
    """

    def __init__(self, source, name="device"):
        if isinstance(source, dict):
            text = "\n".join(_toml_tables(_nested(source), "")) + "\n"
            self._device = _ringlock.Device.from_text(text, name)
        else:
            self._device = _ringlock.Device.from_file(_os.fspath(source))

    @property
    def name(self):
        """Name of the file without its ending, or the one that was given."""
        return self._device.name

    @property
    def summary(self):
        """One sentence on the device; may be empty."""
        return self._device.summary


class Scenario:
    """A study that can be run. Every change is checked with all rules of scenarios.

    source: None (the device of Gao and Deng with the default ensemble), the path of a TOML file, or a dict of keys,
    nested as in the file or with dots: {"ensemble": {"gyros": 16}, "gyro.lockin_threshold_deg_h": 150}.
    settings: keys that replace those of the source, {"ensemble.seed": 7}. docs/scenario.md lists all keys.
    """

    def __init__(self, source=None, *, settings=None):
        if source is None:
            source = {}
        if isinstance(source, Scenario):
            self._scenario = source._scenario.copy()
            self._scenario.set(_settings(settings))
        elif isinstance(source, dict):
            text = "\n".join(_toml_tables(_nested(source), "")) + "\n"
            self._scenario = _ringlock.Scenario.from_text(text, _settings(settings), "scenario")
        else:
            self._scenario = _ringlock.Scenario.from_file(_os.fspath(source), _settings(settings))

    @classmethod
    def from_toml(cls, text, *, settings=None, name="scenario"):
        """A scenario from TOML text; `name` stands in messages in place of the file."""
        return cls._of(_ringlock.Scenario.from_text(text, _settings(settings), name))

    @classmethod
    def _of(cls, scenario):
        out = cls.__new__(cls)
        out._scenario = scenario
        return out

    def set(self, settings):
        """Replaces values of keys, all or none of them: set({"ensemble.gyros": 8, "ensemble.duration_s": 60})."""
        self._scenario.set(_settings(settings))
        return self

    def use(self, device):
        """Takes the constants of a Device (or of what Device() takes) in place of those of the scenario."""
        self._scenario.use((device if isinstance(device, Device) else Device(device))._device)
        return self

    def __getitem__(self, key):
        return self._scenario.value(key)

    def __setitem__(self, key, value):
        self.set({key: value})

    def to_toml(self):
        """All keys as TOML."""
        return self._scenario.to_toml()

    @property
    def name(self):
        """The file, or "scenario"."""
        return self._scenario.name

    def __repr__(self):
        return f"<ringlock.Scenario {self.name}>"


# --- Results ---------------------------------------------------------------------------------------------------------


class AngleRecord:
    """Angle samples of the gyros of an arm: `angle_arcsec[gyro, sample]`, read-only, `interval_s` apart from time 0."""

    def __init__(self, angle_arcsec, interval_s):
        self.angle_arcsec = angle_arcsec
        self.interval_s = interval_s

    @property
    def time_s(self):
        """Times of the samples."""
        return self.interval_s * _np.arange(self.angle_arcsec.shape[1])


class Result:
    """The outcome of a run, or a result file of the program.

    Arrays of an arm (`gyro_...`) and of angle records are read-only views of the memory of the result.
    """

    def __init__(self, result):
        self._result = result

    def arms(self, point=0):
        """Arms by their names, of a point of the design (0 without a design)."""
        return {arm.name: arm for arm in self._result.arms(point)}

    def __getitem__(self, arm):
        arms = self.arms()
        if arm not in arms:
            raise InputError(f'arm "{arm}": is not in the result, which has {", ".join(arms)}')
        return arms[arm]

    def theory(self, point=0):
        """Closed-form figures of the device without spread."""
        return self._result.theory(point)

    def values(self, point=0):
        """Values at a point of the keys that the design varies."""
        return dict(self._result.values(point))

    @property
    def points(self):
        """Number of points of the design; 1 without a design."""
        return self._result.points

    @property
    def seed(self):
        """Seed of the random numbers."""
        return self._result.seed

    @property
    def turns(self):
        """Zero-rate points of distinct physical trajectories."""
        return self._result.turns

    @property
    def wall_s(self):
        """Duration of the run [s]."""
        return self._result.wall_s

    @property
    def scenario(self):
        """The scenario that was run."""
        return Scenario._of(self._result.scenario())

    def angle_record(self, arm, point=0):
        """Angle samples of an arm. Raises InputError where output.angle_record was false."""
        return AngleRecord(*self._result.angle_record(arm, point))

    def write(self, path):
        """Writes the result file, whole or not at all; results/FORMAT.md describes it."""
        self._result.write(_os.fspath(path))

    def to_json(self):
        """The text that `ringlock run --json` prints."""
        return self._result.to_json()

    def to_dict(self):
        """The object that `ringlock run --json` prints; docs/commands.md describes its fields."""
        return _json.loads(self._result.to_json())

    def __repr__(self):
        return f"<ringlock.Result of {self._result.scenario().name}: {self.turns} turns>"


def _scenario_of(scenario):
    return scenario if isinstance(scenario, Scenario) else Scenario(scenario)


def run(scenario=None, *, settings=None, threads=0, progress=None):
    """Simulates the ensemble of a scenario and compares its arms.

    scenario: a path, a dict, a Scenario, or None for the empty one
    settings: keys that replace those of the scenario, {"ensemble.gyros": 16}
    threads:  0 for all cores; the result does not depend on it
    progress: called now and then with a Progress

    Returns a Result. Raises InputError, RunError, KeyboardInterrupt, and what `progress` raises. Other threads of
    Python go on meanwhile.
    """
    scenario = Scenario(_scenario_of(scenario), settings=settings)
    return Result(_ringlock.run(scenario._scenario, threads, progress))


def read(path):
    """Reads a result file as a Result. Raises InputError where it is none or is damaged."""
    return Result(_ringlock.Result.read(_os.fspath(path)))


# --- Allan deviations ------------------------------------------------------------------------------------------------


def _columns(points):
    """Points, each a dict, as one array for each of their keys; null becomes NaN."""
    columns = {}
    for key in points[0] if points else ():
        values = [point[key] for point in points]
        whole = all(isinstance(v, int) for v in values)
        columns[key] = _np.array(values if whole else [_math.nan if v is None else v for v in values],
                                 dtype=_np.int64 if whole else _np.float64)
    return columns


def _series(data):
    if isinstance(data, _np.ma.MaskedArray):
        data = data.astype(_np.float64).filled(_math.nan)
    return _np.asarray(data)


def _allan_of_one(series, keywords):
    if series.dtype.kind in "iub":
        if series.dtype == _np.uint64 and series.size and series.max() > _np.iinfo(_np.int64).max:
            raise InputError("data: has counts beyond 63 bits")
        text = _ringlock.allan_whole(series, keywords)
    elif series.dtype.kind == "f":
        text = _ringlock.allan_real(series, keywords)
    else:
        raise InputError(f"data: are of type {series.dtype}; they must be real numbers")
    out = _json.loads(text)
    out["deviations"] = {name: _columns(points) for name, points in out["deviations"].items()}
    return out


def allan(
    data,
    *,
    rate_hz=None,
    tau0_s=None,
    kind,
    unit=None,
    scale=1.0,
    deviations=("oadev",),
    taus="octave",
    confidence=0.682689492137,
    bias="published",
    wrap="off",
    clean=False,
    arw_unit=None,
    column=None,
):
    """Deviations of the Allan family with intervals, and noise coefficients.

    data:       samples in time order, NaN (or masked) where one is missing; of two dimensions, one series a column.
                Whole numbers are exact to 63 bits
    rate_hz:    samples a second; or tau0_s, the sampling interval
    kind:       "rate", "increment" or "phase": what the numbers are
    unit:       "deg/h", "deg/s", "rad/s", "arcsec", "deg", "rad", "m/s^2", "mg", "m/s", "s", "ns"; without it no noise
                coefficients are estimated
    scale:      size of one number of the data in that unit
    deviations: names of deviations, or one string with commas: "oadev,mdev"
    taus:       "octave", "decade", "all", "1,2,4" (factors), "0.5s,10min" (times), or a list of averaging factors
    confidence: level of the intervals of the deviations
    bias:       "published", "exact" or "raw" (docs/allan.md)
    wrap:       "off", "auto" or a modulus: undo wraps of a counter or an angle
    clean:      take outliers and jumps off, and leave disturbed stretches and repeated values out
    arw_unit:   also the random walk in this unit, "deg/h/sqrt(Hz)"
    column:     name of the series (or, of several, their names)

    Returns what `ringlock allan --json` prints, a dict; each deviation is a dict of arrays "m", "tau_s", "dev", "lo",
    "hi", "edf", "alpha", "bias", "terms", with NaN for null. Data of two dimensions give a list of such dicts. Raises
    InputError. Other threads of Python go on meanwhile; Ctrl-C waits for the end.
    """
    data = _series(data)
    if isinstance(deviations, str):
        deviations = [name.strip() for name in deviations.split(",")]
    if not isinstance(taus, str):
        taus = ",".join(str(int(m)) for m in taus)
    keywords = {
        "rate_hz": rate_hz,
        "tau0_s": tau0_s,
        "kind": kind,
        "unit": unit,
        "scale": scale,
        "deviations": list(deviations),
        "taus": taus,
        "confidence": confidence,
        "bias": bias,
        "wrap": str(wrap),
        "clean": clean,
        "arw_unit": arw_unit,
    }
    if data.ndim == 1:
        return _allan_of_one(data, {**keywords, "column": column})
    if data.ndim != 2:
        raise InputError(f"data: has {data.ndim} dimensions; it must have one, or two with a series in each column")
    names = [str(i + 1) for i in range(data.shape[1])] if column is None else list(column)
    if len(names) != data.shape[1]:
        raise InputError(f"column: has {len(names)} names for {data.shape[1]} series")
    return [_allan_of_one(data[:, i], {**keywords, "column": name}) for i, name in enumerate(names)]


# --- Closed loop -----------------------------------------------------------------------------------------------------


class Record:
    """A measured record. Record(path) reads one: an rlg-record (HDF5) or its form as text; docs/record.md."""

    def __init__(self, path, *, follow_links=False):
        self._record = _ringlock.Record.from_file(_os.fspath(path), follow_links)

    @classmethod
    def _of(cls, record):
        out = cls.__new__(cls)
        out._record = record
        return out

    @staticmethod
    def _around(columns, declared, temperature_c, input_rate_deg_h):
        columns["declared"] = {key: float(value) for key, value in (declared or {}).items()}
        if temperature_c is not None:
            columns["temperature_time_s"], columns["temperature_value_c"] = temperature_c
        if input_rate_deg_h is not None:
            columns["input_rate_time_s"], columns["input_rate_value_deg_h"] = input_rate_deg_h
        return columns

    @classmethod
    def samples(
        cls,
        *,
        rate_hz,
        angle_increment_arcsec=None,
        angle_arcsec=None,
        quarter_count=None,
        t0_s=0.0,
        witnesses=None,
        declared=None,
        temperature_c=None,
        input_rate_deg_h=None,
        name="record",
    ):
        """A record of uniform samples, of which one of the three columns must be given; NaN where one is missing.

        witnesses: arrays of the same length by their names: accel_x, accel_y, accel_z, temperature_c
        declared:  what is known of the instrument: scale_factor_arcsec, lockin_threshold_deg_h, dither_frequency_hz,
                   dither_peak_rate_deg_s, bias_deg_h, clock_hz, readout_noise_rad, input_rate_deg_h
        temperature_c, input_rate_deg_h: a pair of arrays each, times [s] and values

        Raises InputError where the data are no record.
        """
        columns = {"witnesses": dict(witnesses or {})}
        given = {
            "angle_increment_arcsec": angle_increment_arcsec,
            "angle_arcsec": angle_arcsec,
            "quarter_count": quarter_count,
        }
        columns.update({key: value for key, value in given.items() if value is not None})
        cls._around(columns, declared, temperature_c, input_rate_deg_h)
        return cls._of(_ringlock.Record.of_samples(float(rate_hz), float(t0_s), columns, name))

    @classmethod
    def turns(
        cls,
        *,
        time_s,
        direction,
        quarter_count,
        sin,
        cos,
        accel_before_rad_s2=None,
        accel_after_rad_s2=None,
        declared=None,
        temperature_c=None,
        input_rate_deg_h=None,
        name="record",
    ):
        """A record of consecutive zero-rate points of the dither, one row each; docs/record.md defines the columns.

        The other arguments are those of samples(). Raises InputError where the data are no record.
        """
        columns = {"time_s": time_s, "direction": direction, "quarter_count": quarter_count, "sin": sin, "cos": cos}
        given = {"accel_before_rad_s2": accel_before_rad_s2, "accel_after_rad_s2": accel_after_rad_s2}
        columns.update({key: value for key, value in given.items() if value is not None})
        cls._around(columns, declared, temperature_c, input_rate_deg_h)
        return cls._of(_ringlock.Record.of_turns(columns, name))

    def write(self, path):
        """Writes the HDF5 form, whole or not at all."""
        self._record.write(_os.fspath(path))

    def __len__(self):
        return len(self._record)

    @property
    def name(self):
        """The file, or the name that was given."""
        return self._record.name

    def __repr__(self):
        return f"<ringlock.Record {self.name}: {len(self)} rows>"


def simulate_record(scenario=None, *, gyro=0):
    """The record that the electronics of a gyro of the scenario would have made; the same as `ringlock record`."""
    return Record._of(_ringlock.simulate_record(_scenario_of(scenario)._scenario, gyro))


class Closure(dict):
    """The object that `ringlock closure --json` prints, a dict; docs/commands.md describes its fields.

    text:     the report for people
    scenario: the device as fitted with the effects that were added, to be run
    """

    def __init__(self, closure):
        super().__init__(_json.loads(closure.to_json()))
        self.text = closure.to_text()
        self.scenario = Scenario._of(closure.scenario())


def close(record, *, model=None, threads=0, progress=None):
    """Finds the error sources in a measured record that a model of the gyro lacks.

    record:   a path or a Record
    model:    a scenario (path, dict or Scenario) for scale factor, threshold and dither that the record does not
              declare
    threads:  0 for all cores; the outcome does not depend on it
    progress: called now and then with the stage, a string, and its finished share, 0 where that is not known

    Returns a Closure. Raises InputError where the record does not suffice, KeyboardInterrupt, and what `progress`
    raises. Other threads of Python go on meanwhile; several loops follow one another.
    """
    record = record if isinstance(record, Record) else Record(record)
    scenario = None if model is None else _scenario_of(model)._scenario
    return Closure(_ringlock.close_loop(record._record, scenario, threads, progress))
