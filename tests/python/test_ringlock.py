"""The Python module from outside, compared with the program on the same data."""

import ast
import inspect
import json
import os
import pathlib
import signal
import subprocess
import tempfile
import threading
import time
import unittest

import numpy as np
import ringlock

PROGRAM = os.environ["RINGLOCK_PROGRAM"]
SMALL = {"ensemble": {"gyros": 3, "duration_s": 30, "seed": 5}, "arms.names": ["ideal", "noise_injected"]}


def program(*arguments, folder):
    done = subprocess.run([PROGRAM, *arguments], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout


def nulls_to_nan(points):
    """The points of the program's JSON as columns, independently of the module."""
    return {key: np.array([np.nan if p[key] is None else p[key] for p in points], dtype=float) for key in points[0]}


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)


class Allan(InFolder):
    def setUp(self):
        super().setUp()
        self.rates = np.random.default_rng(3).normal(15.0, 3.0, (1500, 2))
        np.savetxt(self.folder / "data.txt", self.rates, fmt="%.17g", header="x y")
        self.keywords = {"rate_hz": 50, "kind": "rate", "unit": "deg/h", "deviations": "oadev,mtie"}
        self.arguments = ["allan", "data.txt", "--rate", "50", "--kind", "rate", "--unit", "deg/h", "--dev",
                          "oadev,mtie", "--json"]

    def assert_equal(self, found, printed):
        self.assertEqual(set(found), set(printed))
        for name, points in printed["deviations"].items():
            for key, column in nulls_to_nan(points).items():
                np.testing.assert_array_equal(found["deviations"][name][key], column, err_msg=f"{name} {key}")
        for key in set(printed) - {"deviations"}:
            self.assertEqual(found[key], printed[key], key)

    def test_gives_the_numbers_of_the_program(self):
        printed = json.loads(program(*self.arguments, "--column", "x", folder=self.folder))
        self.assert_equal(ringlock.allan(self.rates[:, 0], column="x", **self.keywords), printed)

    def test_of_two_dimensions_gives_a_list_of_the_columns(self):
        printed = json.loads(program(*self.arguments, "--column", "x,y", folder=self.folder))["series"]
        found = ringlock.allan(self.rates, column=["x", "y"], **self.keywords)
        self.assertEqual(len(found), 2)
        for one, other in zip(found, printed):
            del other["data"]
            self.assert_equal(one, other)

    def test_missing_data_are_nan_or_masked(self):
        rates = self.rates[:, 0].copy()
        rates[7] = np.nan
        masked = np.ma.masked_invalid(rates)
        one = ringlock.allan(rates, **self.keywords)
        self.assertEqual(one["missing"], 1)
        self.assertEqual(ringlock.allan(masked, **self.keywords)["noise"], one["noise"])

    def test_whole_numbers_are_exact(self):
        counts = (1 << 60) + np.cumsum(np.resize([3, 4], 64))
        found = ringlock.allan(counts, tau0_s=1, kind="phase", taus=[1])
        # Second differences are +-1.
        self.assertAlmostEqual(found["deviations"]["oadev"]["dev"][0], np.sqrt(0.5), places=12)
        self.assertEqual(found["deviations"]["oadev"]["m"].dtype, np.int64)

    def test_lists_and_other_layouts_are_taken(self):
        expected = ringlock.allan(np.ascontiguousarray(self.rates[:, 1]), **self.keywords)["noise"]
        self.assertEqual(ringlock.allan(list(self.rates[:, 1]), **self.keywords)["noise"], expected)
        self.assertEqual(ringlock.allan(self.rates[:, 1], **self.keywords)["noise"], expected)

    def test_wrong_input_is_a_value_error(self):
        self.assertTrue(issubclass(ringlock.InputError, ValueError))
        self.assertTrue(issubclass(ringlock.RunError, RuntimeError))
        rates = self.rates[:, 0]
        for words, keywords in {
            "kind = 'speed'": {"rate_hz": 50, "kind": "speed"},
            "rate_hz: is required": {"kind": "rate"},
            "unit": {"rate_hz": 50, "kind": "rate", "unit": "furlong"},
            "taus 100000": {"rate_hz": 50, "kind": "rate", "taus": [100000]},
            "deviations: 'sdev'": {"rate_hz": 50, "kind": "rate", "deviations": "sdev"},
        }.items():
            with self.assertRaisesRegex(ringlock.InputError, words):
                ringlock.allan(rates, **keywords)
        with self.assertRaisesRegex(ringlock.InputError, "3 dimensions"):
            ringlock.allan(np.zeros((2, 2, 2)), rate_hz=1, kind="rate")
        with self.assertRaisesRegex(ringlock.InputError, "complex128"):
            ringlock.allan(np.zeros(9, dtype=complex), rate_hz=1, kind="rate")
        with self.assertRaises(TypeError):
            ringlock.allan(rates, rate_hz=1, kind="rate", units="deg/h")


class Run(InFolder):
    @classmethod
    def setUpClass(cls):
        cls.result = ringlock.run(SMALL)

    def test_gives_the_json_of_the_program(self):
        self.result.write(self.folder / "own.h5")
        printed = json.loads(program("analyze", "own.h5", "--json", folder=self.folder))
        self.assertEqual(self.result.to_dict(), printed)
        (self.folder / "s.toml").write_text(
            '[ensemble]\ngyros = 3\nduration_s = 30\nseed = 5\n[arms]\nnames = ["ideal", "noise_injected"]\n')
        program("run", "s.toml", "-o", "r.h5", "-q", folder=self.folder)
        read = ringlock.read(self.folder / "r.h5")
        self.assertEqual(read.to_dict()["arms"], printed["arms"])
        np.testing.assert_array_equal(read.angle_record("noise_injected").angle_arcsec,
                                      self.result.angle_record("noise_injected").angle_arcsec)
        self.assertEqual(ringlock.run(self.folder / "s.toml").to_dict()["arms"], printed["arms"])

    def test_figures_of_gyros_are_views(self):
        arm = self.result["noise_injected"]
        self.assertEqual(arm.gyro_rate_error_deg_h.shape, (3,))
        self.assertEqual(arm.gyro_allan_dev_deg_h.shape, (3, len(arm.gyro_allan_tau_s)))
        self.assertFalse(arm.gyro_arw_deg_rt_h.flags.writeable)
        self.assertFalse(arm.gyro_arw_deg_rt_h.flags.owndata)
        self.assertAlmostEqual(arm.gyro_rate_error_deg_h.mean(), arm.rate_error_deg_h.mean, places=12)
        record = self.result.angle_record("noise_injected")
        # The sample at time 0 and 29 whole intervals.
        self.assertEqual(record.angle_arcsec.shape, (3, 30))
        self.assertEqual(record.time_s[-1], 29 * record.interval_s)
        self.assertEqual(record.angle_arcsec.ctypes.data,
                         self.result.angle_record("noise_injected").angle_arcsec.ctypes.data)
        # Views outlive the objects that they came from.
        angles = ringlock.run(SMALL).angle_record("noise_injected").angle_arcsec
        np.testing.assert_array_equal(angles, record.angle_arcsec)
        errors = ringlock.run(SMALL)["noise_injected"].gyro_rate_error_deg_h
        np.testing.assert_array_equal(errors, arm.gyro_rate_error_deg_h)

    def test_random_walk_is_that_of_theory(self):
        result = ringlock.run(SMALL, settings={"ensemble.duration_s": 120})
        # 120 samples give it to 6.5 % a gyro; the median of three is within four standard errors.
        arw = result["noise_injected"].arw_deg_rt_h
        self.assertAlmostEqual(arw.median / result.theory().arw_deg_rt_h, 1.0, delta=0.2)
        self.assertIsNone(result["ideal"].bias_instability_deg_h)

    def test_settings_and_designs(self):
        design = {**SMALL, "output.angle_record": False,
                  "design": {"kind": "grid",
                             "vary": [{"key": "gyro.lockin_threshold_deg_h", "values": np.array([100.0, 400.0])}]}}
        result = ringlock.run(design, settings={"ensemble.gyros": np.int64(2)})
        self.assertEqual(result.points, 2)
        self.assertEqual(result.values(1), {"gyro.lockin_threshold_deg_h": 400.0})
        self.assertEqual(result.arms(1)["ideal"].gyros, 2)
        with self.assertRaisesRegex(ringlock.InputError, "output.angle_record = true"):
            result.angle_record("ideal")

    def test_scenarios_are_checked(self):
        scenario = ringlock.Scenario(SMALL)
        scenario["gyro.lockin_threshold_deg_h"] = 150
        self.assertEqual(scenario["gyro.lockin_threshold_deg_h"], 150.0)
        self.assertEqual(scenario["arms.names"], ["ideal", "noise_injected"])
        with self.assertRaisesRegex(ringlock.InputError, "did you mean"):
            scenario["gyro.lockin_treshold_deg_h"] = 150
        with self.assertRaisesRegex(ringlock.InputError, "no scenario has it"):
            scenario["gyro.colour"]
        with self.assertRaisesRegex(ringlock.InputError, "is a number, a boolean"):
            ringlock.Scenario({"gyro": {"scale_factor_arcsec": None}})
        with self.assertRaisesRegex(ringlock.InputError, "cannot be read"):
            ringlock.Scenario("none.toml")
        self.assertEqual(ringlock.Scenario.from_toml(scenario.to_toml()).to_toml(), scenario.to_toml())

    def test_devices(self):
        self.assertIn("gao-deng-2007", ringlock.devices())
        scenario = ringlock.Scenario(SMALL).use({"gyro.scale_factor_arcsec": 2, "dither": {"frequency_hz": 410}})
        self.assertEqual(scenario["dither.frequency_hz"], 410.0)
        (self.folder / "mine.toml").write_text('summary = "A prototype"\n[gyro]\nlockin_threshold_deg_h = 90\n')
        device = ringlock.Device(self.folder / "mine.toml")
        self.assertEqual((device.name, device.summary), ("mine", "A prototype"))
        self.assertEqual(scenario.use(device)["gyro.lockin_threshold_deg_h"], 90.0)

    def test_files_of_others_are_kept(self):
        (self.folder / "notes.h5").write_text("mine")
        with self.assertRaises(ringlock.InputError):
            self.result.write(self.folder / "notes.h5")
        self.assertEqual((self.folder / "notes.h5").read_text(), "mine")
        with self.assertRaises(ringlock.InputError):
            ringlock.read(self.folder / "notes.h5")


class Callbacks(InFolder):
    LONG = {"ensemble": {"duration_s": 360000}, "output.angle_record": False}

    def test_progress_reaches_the_end(self):
        seen = []
        ringlock.run(SMALL, progress=lambda now: seen.append((now.stage, now.gyros, now.all_gyros)))
        self.assertEqual(seen[-1][1:], (3, 3))

    def test_an_exception_of_the_callback_ends_the_run(self):
        def fail(_):
            raise LookupError("of the caller")

        with self.assertRaisesRegex(LookupError, "of the caller"):
            ringlock.run(self.LONG, progress=fail)

    def test_ctrl_c_ends_a_run(self):
        threading.Timer(0.5, signal.raise_signal, [signal.SIGINT]).start()
        with self.assertRaises(KeyboardInterrupt):
            ringlock.run(self.LONG)

    def test_other_threads_go_on(self):
        ticks = []
        done = threading.Event()

        def tick():
            while not done.is_set():
                ticks.append(time.monotonic())
                time.sleep(0.001)

        thread = threading.Thread(target=tick)
        thread.start()
        begun = time.monotonic()
        ringlock.run(SMALL)
        ended = time.monotonic()
        done.set()
        thread.join()
        self.assertTrue(any(begun < t < ended for t in ticks))


class Close(InFolder):
    def test_gives_the_json_of_the_program(self):
        (self.folder / "s.toml").write_text("[ensemble]\nduration_s = 8\ngyros = 1\ndither_asymmetry_sd_ratio = 0\n")
        record = ringlock.simulate_record(self.folder / "s.toml")
        record.write(self.folder / "r.h5")
        stages = []
        closure = ringlock.close(record, progress=lambda stage, share: stages.append(stage))
        self.assertEqual(closure, json.loads(program("closure", "r.h5", "--json", "-q", folder=self.folder)))
        self.assertEqual(closure["verdict"], "nothing_missing")
        self.assertTrue(stages)
        self.assertIn("nothing missing", closure.text)
        self.assertGreater(closure.scenario["dither.frequency_hz"], 100.0)

    def test_records_of_arrays(self):
        increments = np.random.default_rng(5).normal(0.0, 1.0, 1200)
        record = ringlock.Record.samples(rate_hz=100, angle_increment_arcsec=increments,
                                         witnesses={"temperature_c": np.full(1200, 20.0)},
                                         declared={"scale_factor_arcsec": 0.5})
        self.assertEqual(len(record), 1200)
        record.write(self.folder / "r.h5")
        self.assertEqual(len(ringlock.Record(self.folder / "r.h5")), 1200)
        with self.assertRaisesRegex(ringlock.InputError, "exactly one"):
            ringlock.Record.samples(rate_hz=100)
        with self.assertRaisesRegex(ringlock.InputError, "declared: 'colour'"):
            ringlock.Record.samples(rate_hz=100, angle_arcsec=increments, declared={"colour": 1})
        with self.assertRaisesRegex(ringlock.InputError, "dimensions"):
            ringlock.Record.samples(rate_hz=100, angle_arcsec=increments.reshape(2, -1))
        with self.assertRaises(ringlock.InputError):
            ringlock.Record.turns(time_s=[0.0], direction=[1], quarter_count=[], sin=[], cos=[])

    def test_a_short_record_is_refused_by_name(self):
        record = ringlock.simulate_record({"ensemble.duration_s": 1, "output.sample_interval_s": 0.1})
        with self.assertRaisesRegex(ringlock.InputError, "^scenario: "):
            ringlock.close(record)


class Stubs(unittest.TestCase):
    """The stubs for type checkers name what the module has, with the same arguments."""

    @staticmethod
    def arguments_of(function):
        a = function.args
        return [x.arg for x in a.posonlyargs + a.args + a.kwonlyargs]

    def test_agree_with_the_module(self):
        folder = pathlib.Path(inspect.getfile(ringlock)).parent
        self.assertTrue((folder / "py.typed").exists())
        trees = {name: ast.parse((folder / f"__init__.{name}").read_text()) for name in ("py", "pyi")}
        stub = {n.name: n for n in trees["pyi"].body if isinstance(n, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(set(ringlock.__all__) - {"git_hash"}, set(stub))
        for node in trees["py"].body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                self.assertEqual(self.arguments_of(node), self.arguments_of(stub[node.name]), node.name)
            if isinstance(node, ast.ClassDef):
                methods = {n.name: n for n in stub[node.name].body if isinstance(n, ast.FunctionDef)}
                for method in (n for n in node.body if isinstance(n, ast.FunctionDef)):
                    if method.name.startswith("_") and method.name != "__getitem__" or node.name == "Closure":
                        continue
                    self.assertIn(method.name, methods, node.name)
                    self.assertEqual(self.arguments_of(method), self.arguments_of(methods[method.name]), method.name)
        # Classes of C++ have no source to compare with.
        for name in ("Arm", "Figure", "MeanFigure", "Progress", "Theory"):
            members = {n.name for n in stub[name].body if isinstance(n, ast.FunctionDef)}
            self.assertEqual(members, {m for m in dir(getattr(ringlock, name)) if not m.startswith("_")}, name)

    def test_everything_public_is_described(self):
        for name in ringlock.__all__:
            self.assertTrue(getattr(ringlock, name).__doc__, name)


if __name__ == "__main__":
    unittest.main()
