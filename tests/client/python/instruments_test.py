"""The doctor, calibrations, patterns, previews and live composites against a server and a camera node that this test plays, and the errors
of a server that cannot do what it is asked."""

import concurrent.futures
import struct
import threading
import unittest
import zlib

import grpc
import numpy as np

import glasswing
from glasswing.pictures import encode_png8
from glasswing.v1 import (
    archive_pb2,
    calibration_pb2,
    camera_service_pb2,
    camera_service_pb2_grpc,
    clock_service_pb2,
    clock_service_pb2_grpc,
    live_service_pb2,
    live_service_pb2_grpc,
    node_service_pb2,
    node_service_pb2_grpc,
    plan_pb2,
    rig_service_pb2,
    rig_service_pb2_grpc,
    session_service_pb2_grpc,
)

STORE_AWAY = "the job store does not answer: PostgreSQL at db.lab: connection refused; start it"


class Server(
    node_service_pb2_grpc.NodeServiceServicer,
    rig_service_pb2_grpc.RigServiceServicer,
    camera_service_pb2_grpc.CameraServiceServicer,
    clock_service_pb2_grpc.ClockServiceServicer,
    live_service_pb2_grpc.LiveServiceServicer,
    session_service_pb2_grpc.SessionServiceServicer,
):
    """A server, and its camera node and solver at the same address."""

    def __init__(self) -> None:
        self.asked: list[object] = []
        self.two_cameras = False
        self.needs_operator = False
        self.pattern_ended = threading.Event()
        self.polls_until_freed = 0
        self.object_brought = threading.Event()
        self.ramp_ended = threading.Event()
        self.server = grpc.server(concurrent.futures.ThreadPoolExecutor(8))
        node_service_pb2_grpc.add_NodeServiceServicer_to_server(self, self.server)
        rig_service_pb2_grpc.add_RigServiceServicer_to_server(self, self.server)
        camera_service_pb2_grpc.add_CameraServiceServicer_to_server(self, self.server)
        clock_service_pb2_grpc.add_ClockServiceServicer_to_server(self, self.server)
        live_service_pb2_grpc.add_LiveServiceServicer_to_server(self, self.server)
        session_service_pb2_grpc.add_SessionServiceServicer_to_server(self, self.server)
        self.address = f"127.0.0.1:{self.server.add_insecure_port('127.0.0.1:0')}"
        self.server.start()

    def ListNodes(self, request, context):
        answer = node_service_pb2.ListNodesResponse()
        camera = answer.nodes.add(kind=node_service_pb2.NODE_KIND_CAMERA, name="camera-1", address=self.address, up=True)
        preparation = node_service_pb2.Preparation(what="simulating the scene", done=0.379)
        if self.polls_until_freed and self.pattern_ended.wait(30):
            self.polls_until_freed -= 1
            answer.holder.what = "pattern lines"
        answer.nodes.add(kind=camera.kind, name="camera-2", address="127.0.0.1:1", up=self.two_cameras, preparation=preparation)
        return answer

    def CheckRig(self, request, context):
        self.asked.append(request)
        finding = rig_service_pb2.Finding(level=rig_service_pb2.FINDING_LEVEL_OK, subject="clocks", text="are known")
        yield rig_service_pb2.CheckRigResponse(finding=finding)
        finding = rig_service_pb2.Finding(level=rig_service_pb2.FINDING_LEVEL_WARNING, subject="flips", text="5 late", advice="hold")
        yield rig_service_pb2.CheckRigResponse(finding=finding)

    def CalibrateSync(self, request, context):
        self.asked.append(request)
        yield rig_service_pb2.CalibrateSyncResponse(progress="measuring back")
        measured = calibration_pb2.MonitorSync(monitor="back", lag_ns=2_880_000, settle_ns=1_130_000, error_ns=30_000)
        yield rig_service_pb2.CalibrateSyncResponse(result=measured)

    def ShowPattern(self, request, context):
        self.asked.append(request)
        if request.pattern == "purple":
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, 'the pattern is "purple"; it must be white')
        context.add_callback(self.pattern_ended.set)
        yield rig_service_pb2.ShowPatternResponse(monitors=["back"])
        self.pattern_ended.wait()

    def Preview(self, request, context):
        self.asked.append(request)
        preparation = node_service_pb2.Preparation(what="waiting for the monitors' light")
        yield camera_service_pb2.PreviewResponse(preparation=preparation)
        while context.is_active():
            yield camera_service_pb2.PreviewResponse(jpeg=b"\xff\xd8\xff", width_px=8, height_px=6, focus=0.5, exposure_ms=2.0)
            yield camera_service_pb2.PreviewResponse(jpeg=b"\xff\xd8\xff", focus_hint="too dark to judge focus")

    def MakePlan(self, request, context):
        self.asked.append(request)
        plan = plan_pb2.Plan(method="gaussian", monitors=[plan_pb2.PlanMonitor(name="back")])
        return rig_service_pb2.MakePlanResponse(plan=plan)

    def ShowRamp(self, requests, context):
        context.add_callback(self.ramp_ended.set)
        for request in requests:
            self.asked.append(request)
            if request.object:
                self.object_brought.set()
            yield rig_service_pb2.ShowRampResponse(
                camera_address=self.address,
                solver_address=self.address,
                monitor=archive_pb2.Monitor(name="back", width_px=8, height_px=6),
                needs_operator=self.needs_operator,
            )

    def Exchange(self, request, context):
        return clock_service_pb2.ExchangeResponse(received_ns=1000, sent_ns=1001)

    def RunLive(self, requests, context):
        """Composites of 2 x 1 pixels: one of the empty stage, one exposed before the object came, then one in two parts."""
        start, picture = next(requests), next(requests)
        self.asked += [start, picture]
        yield live_service_pb2.RunLiveResponse(empty_frames_left=1)
        early = camera_service_pb2.FrameTaken(width_px=2, height_px=1, exposure_start_ns=5)
        frame = live_service_pb2.LiveFrame(taken=early, picture=bytes(6))
        yield live_service_pb2.RunLiveResponse(frame=frame)
        yield live_service_pb2.RunLiveResponse()
        self.object_brought.wait(30)
        yield live_service_pb2.RunLiveResponse(frame=frame)
        taken = camera_service_pb2.FrameTaken(width_px=2, height_px=1, exposure_start_ns=2000)
        frame = live_service_pb2.LiveFrame(taken=taken, picture=bytes([1, 2, 3]), object_pixel_count=1, solve_ms=2.5)
        yield live_service_pb2.RunLiveResponse(frame=frame)
        yield live_service_pb2.RunLiveResponse(frame=live_service_pb2.LiveFrame(picture=bytes([4, 5, 6])))
        ended = threading.Event()
        if context.add_callback(ended.set):
            ended.wait()

    def GetSession(self, request, context):
        context.abort(grpc.StatusCode.UNAVAILABLE, STORE_AWAY)


class InstrumentsTest(unittest.TestCase):
    def setUp(self) -> None:
        self.server = Server()
        self.addCleanup(self.server.server.stop, None)
        self.rig = glasswing.connect(self.server.address)
        self.addCleanup(self.rig.close)

    def test_the_doctor_yields_findings(self) -> None:
        findings = list(self.rig.doctor(glasswing.Plan(method="gaussian", hold_refreshes=3)))
        self.assertEqual([finding.level for finding in findings], [glasswing.Level.OK, glasswing.Level.WARNING])
        self.assertEqual([str(finding) for finding in findings], ["ok: clocks: are known", "warning: flips: 5 late -> hold"])
        self.assertEqual(self.server.asked[0].plan.hold_refreshes, 3)
        list(self.rig.doctor())
        self.assertFalse(self.server.asked[1].HasField("plan"))

    def test_latencies_are_measured(self) -> None:
        self.assertEqual(self.rig.calibrate_sync(["back"]), [glasswing.MonitorLatency("back", 2.88, 1.13, 0.03)])
        self.assertEqual(list(self.server.asked[0].monitors), ["back"])

    def test_a_pattern_is_shown_while_the_block_runs(self) -> None:
        with self.rig.pattern("lines") as monitors:
            self.assertEqual(monitors, ["back"])
            self.assertFalse(self.server.pattern_ended.is_set())
        self.assertTrue(self.server.pattern_ended.wait(30))
        with self.assertRaisesRegex(glasswing.InvalidInput, "purple"), self.rig.pattern("purple"):
            pass

    def test_the_rig_is_free_after_a_pattern(self) -> None:
        # A cancelled call ends here before the server notices.
        with self.rig.pattern("lines"):
            self.server.polls_until_freed = 3
        self.assertEqual(self.server.polls_until_freed, 0)
        self.assertIsNone(self.rig.holder())

    def test_a_notebook_shows_the_rig_with_the_words_of_others_escaped(self) -> None:
        shown = self.rig._repr_html_()
        self.assertIn("<td>camera-1</td><td>up</td>", shown)
        self.assertIn("<td>camera-2</td><td>away</td>", shown)
        self.assertIn("&lt;rig of the server at ", shown)
        self.server.server.stop(None).wait()
        self.assertIn("does not answer", self.rig._repr_html_())

    def test_a_node_says_what_it_prepares(self) -> None:
        ready, preparing = self.rig.nodes()
        self.assertIsNone(ready.preparation)
        self.assertEqual(preparing.preparation, glasswing.Preparation("simulating the scene", 0.379))
        self.assertEqual(str(preparing.preparation), "simulating the scene, 37 %")
        self.assertEqual(str(glasswing.Preparation("opening the camera", None)), "opening the camera")

    def test_a_preview_goes_on_until_its_loop_is_left(self) -> None:
        pictures = self.rig.preview(max_fps=5, exposure_ms=2)
        first, second = next(pictures), next(pictures)
        pictures.close()
        self.assertEqual((first.focus, first.focus_hint, first.width_px, first._repr_jpeg_()), (0.5, "", 8, b"\xff\xd8\xff"))
        self.assertEqual(second.focus_hint, "too dark to judge focus")
        self.assertEqual((self.server.asked[0].max_fps, self.server.asked[0].max_width_px), (5.0, 640))
        with self.assertRaisesRegex(glasswing.Unavailable, 'camera node "camera-2" is not up'):
            next(self.rig.preview(camera="camera-2"))
        self.server.two_cameras = True
        with self.assertRaisesRegex(glasswing.Refused, "several cameras, camera-1, camera-2"):
            next(self.rig.preview())

    def test_a_plan_is_made_for_the_rig(self) -> None:
        plan = self.rig.make_plan("best", images=800, blur_px=1.5, object="metal")
        self.assertEqual((plan.method, plan.monitors[0].name), ("gaussian", "back"))
        (asked,) = self.server.asked
        self.assertEqual((asked.quality, asked.image_count, asked.blur_px, asked.object), ("best", 800, 1.5, "metal"))

    def test_live_composites_are_of_the_object_alone(self) -> None:
        self.server.needs_operator = True
        told: list[str] = []
        live = self.rig.live(np.zeros((3, 4, 3)), monitor="back", exposure_ms=2, options={"light": "1"}, ask=told.append)
        composite = next(live)
        np.testing.assert_array_equal(composite.codes, [[[1, 2, 3], [4, 5, 6]]])
        self.assertEqual((composite.object_pixels, composite.solve_ms), (1, 2.5))
        self.assertEqual(told, ["Take the object off the stage", "The empty stage is known. Bring the object"])
        self.assertFalse(self.server.ramp_ended.is_set())
        live.close()
        self.assertTrue(self.server.ramp_ended.wait(30))
        ramp, start, picture, brought = self.server.asked[:4]
        self.assertEqual((ramp.monitor, ramp.object, brought.object), ("back", False, True))
        self.assertEqual((start.start.exposure_ms, start.start.monitor.width_px, dict(start.start.options)), (2.0, 8, {"light": "1"}))
        self.assertTrue(picture.picture_ends)
        self.assertEqual(struct.unpack(">II", picture.picture[16:24]), (8, 6))

    def test_the_servers_advice_is_not_lost(self) -> None:
        with self.assertRaises(glasswing.Unavailable) as caught:
            self.rig.session("vase")
        self.assertEqual(str(caught.exception), STORE_AWAY)
        self.server.server.stop(None).wait()
        with self.assertRaisesRegex(glasswing.Unavailable, f"server at {self.server.address} does not answer"):
            self.rig.nodes()


class PngTest(unittest.TestCase):
    def test_codes_come_back_from_a_png(self) -> None:
        for channels in (3, 4):
            codes = np.random.default_rng(1).integers(0, 256, (5, 7, channels), np.uint8)
            png = encode_png8(codes)
            self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
            chunks, at = {}, 8
            while at < len(png):
                (length,) = struct.unpack(">I", png[at : at + 4])
                kind, content = png[at + 4 : at + 8], png[at + 8 : at + 8 + length]
                self.assertEqual(struct.unpack(">I", png[at + 8 + length : at + 12 + length])[0], zlib.crc32(kind + content))
                chunks[kind] = content
                at += 12 + length
            self.assertEqual(struct.unpack(">IIBB", chunks[b"IHDR"][:10]), (7, 5, 8, {3: 2, 4: 6}[channels]))
            rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(5, 1 + 7 * channels)
            self.assertFalse(rows[:, 0].any())
            np.testing.assert_array_equal(rows[:, 1:].reshape(codes.shape), codes)


if __name__ == "__main__":
    unittest.main()
