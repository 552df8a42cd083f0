"""Against a server that the caller starts: FIDUCAP_TEST_PORT; bodies drone, arm and cart of scene_builder.hpp."""

import math
import os
import pathlib
import subprocess
import sys
import time
import unittest

import fiducap

PORT = int(os.environ["FIDUCAP_TEST_PORT"])
PATIENCE_S = 20.0


class ClientTest(unittest.TestCase):
    def test_reads_poses_names_and_times(self):
        with fiducap.Client(port=PORT, name="python") as client:
            frame = client.wait(0, PATIENCE_S)
            self.assertIsNotNone(frame, client.statistics().problem)
            self.assertEqual(list(frame.bodies), ["drone", "arm", "cart"])
            arm = frame.bodies["arm"]
            self.assertTrue(arm.valid)
            self.assertIs(arm.tracking, fiducap.Tracking.TRACKING)
            self.assertEqual(arm.position_m, (2.0, -2.0, 0.5))
            self.assertAlmostEqual(sum(q * q for q in arm.orientation_wxyz), 1.0)
            self.assertEqual(arm.velocity_m_s, (0.5, -0.25, 0.125))
            self.assertAlmostEqual(arm.pose_covariance[0], 1e-4, places=9)
            self.assertAlmostEqual(arm.velocity_sigma_m_s, 1e-2, places=6)
            self.assertEqual(arm.tags_in_view, 3)
            self.assertLess(abs(time.monotonic_ns() - frame.received_ns), PATIENCE_S * 1e9)

    def test_frames_go_on(self):
        with fiducap.Client(port=PORT) as client:
            numbers = []
            for frame in client.frames(PATIENCE_S):
                numbers.append(frame.number)
                if len(numbers) == 20:
                    break
            self.assertEqual(len(numbers), 20)
            self.assertEqual(numbers, sorted(set(numbers)))
            statistics = client.statistics()
            self.assertTrue(statistics.connected)
            self.assertGreaterEqual(statistics.frames, 20)

    def test_gets_what_it_asks_for(self):
        with fiducap.Client(port=PORT, up="y", bodies=["cart"], covariance=False) as client:
            frame = client.wait(0, PATIENCE_S)
            self.assertEqual(list(frame.bodies), ["cart"])
            self.assertEqual(frame.bodies["cart"].position_m, (3.0, 0.5, 2.0))
            self.assertTrue(math.isnan(frame.bodies["cart"].pose_covariance[0]))

    def test_predicts(self):
        with fiducap.Client(port=PORT) as client:
            client.wait(0, PATIENCE_S)
            body = client.predict("drone", 0.1)
            self.assertAlmostEqual(body.position_m[0], 1.05)
            self.assertGreater(body.position_sigma_m, 0.01)
            self.assertIsNone(client.predict("nobody", 0.1))
            self.assertIsNone(client.predict("drone", 10.0))

    def test_says_what_cannot_be(self):
        with self.assertRaisesRegex(ValueError, "up"):
            fiducap.Client(up="x")
        with self.assertRaisesRegex(ValueError, "32 bodies"):
            fiducap.Client(bodies=["b"] * 33)
        client = fiducap.Client(port=PORT)
        client.close()
        client.close()
        with self.assertRaises(RuntimeError):
            client.latest()

    def test_discovers(self):
        found = fiducap.discover(0.3, PORT)
        self.assertEqual([(s.address, s.port, s.bodies) for s in found], [("127.0.0.1", PORT, 3)])


class ControlTest(unittest.TestCase):
    def test_lists_and_changes(self):
        with fiducap.Control("correct horse", port=PORT, timeout_s=PATIENCE_S) as control:
            state = control.list()
            self.assertEqual([(b.id, b.name, b.enabled) for b in state.bodies], [(1, "drone", True), (2, "arm", False)])
            control.rename(2, "crane")
            control.set_enabled(2, True)
            control.set_pivot(2, (1, 2, 3), (1, 0, 0, 0))
            control.set_mapping(True)
            control.start_recording("monday")
            state = control.list()
            self.assertEqual(state.bodies[1], fiducap.ControlledBody(2, "crane", True, (1, 2, 3), (1, 0, 0, 0)))
            self.assertTrue(state.mapping)
            self.assertEqual(state.recording, "monday")
            failed = fiducap.Recording("sunday", fiducap.RecordingState.FAILED, "the disk is full", 1200, 34567, 8)
            self.assertEqual(control.recordings(), [failed])
            control.stop_recording()
            control.commit_map()
            with self.assertRaisesRegex(fiducap.ControlError, "no body"):
                control.rename(9, "x")

    def test_refuses_a_wrong_token(self):
        with fiducap.Control("wrong", port=PORT, timeout_s=PATIENCE_S) as control:
            with self.assertRaisesRegex(fiducap.ControlError, "token"):
                control.commit_map()


class EventTest(unittest.TestCase):
    def test_tells_what_happened_and_what_stands(self):
        with fiducap.EventWatch(port=PORT) as watch:
            for event in watch:
                break
            self.assertEqual((event.number, event.subject, event.kind), (1, "drone", "lost"))
            self.assertEqual((event.text, event.remedy), ("lost, sees no tags", "Look at the camera."))
            self.assertIs(event.severity, fiducap.Severity.ERROR)
            self.assertFalse(event.over)
            self.assertEqual(watch.standing(), [event])
            self.assertIsNone(watch.next(0))
            self.assertEqual(watch.problem, "")

    def test_says_why_there_is_nothing(self):
        with fiducap.EventWatch(port=9) as watch:
            self.assertIsNone(watch.next(0))
            self.assertIn("127.0.0.1:9", watch.problem)


class ExampleTest(unittest.TestCase):
    def test_prints_poses(self):
        example = pathlib.Path(__file__).parent.parent / "examples" / "print_poses.py"
        done = subprocess.run(
            [sys.executable, str(example), "127.0.0.1", str(PORT), "0.2"], capture_output=True, text=True, timeout=60
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("cart at 3.000 -2.000 0.500 +/- 10.0 mm", done.stdout)


if __name__ == "__main__":
    unittest.main()
