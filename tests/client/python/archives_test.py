"""Frames, copies, drafts and retries against a server and an archive that this test plays: what it damages, refuses or does
not answer."""

import concurrent.futures
import pathlib
import subprocess
import sys
import tempfile
import unittest

import grpc
import numpy as np

import glasswing
from glasswing import _native
from glasswing.v1 import (
    archive_pb2,
    archive_service_pb2,
    archive_service_pb2_grpc,
    node_service_pb2,
    node_service_pb2_grpc,
    session_pb2,
    session_service_pb2,
    session_service_pb2_grpc,
)

AWAY = "127.0.0.1:1"
HEIGHT, WIDTH, FRAMES = 4, 5, 3
CODES = np.random.default_rng(3).integers(0, 65536, (FRAMES, HEIGHT, WIDTH, 3), np.uint16)
FILE = b"a frame's file"


class Server(
    node_service_pb2_grpc.NodeServiceServicer,
    session_service_pb2_grpc.SessionServiceServicer,
    archive_service_pb2_grpc.ArchiveServiceServicer,
):
    """A server, and a node with a copy of the frames at the same address; the camera node is away."""

    def __init__(self) -> None:
        self.states = [session_pb2.SESSION_STATE_DONE]  # of one watch after the other
        self.asked: list[object] = []
        self.flip = 0  # of the last chunk's bytes
        self.cut = 0
        self.file_name = "frames/{}.tif"
        self.note = ""
        self.size_bytes = len(FILE)
        self.cameras: list[str] = []  # several
        self.server = grpc.server(concurrent.futures.ThreadPoolExecutor(8))
        node_service_pb2_grpc.add_NodeServiceServicer_to_server(self, self.server)
        session_service_pb2_grpc.add_SessionServiceServicer_to_server(self, self.server)
        archive_service_pb2_grpc.add_ArchiveServiceServicer_to_server(self, self.server)
        self.address = f"127.0.0.1:{self.server.add_insecure_port('127.0.0.1:0')}"
        self.server.start()

    def session(self) -> session_pb2.Session:
        copies = [session_pb2.ArchiveCopy(node="solver-2", address=self.address)]
        return session_pb2.Session(
            name="vase", state=self.states[0], created="2026-01-02T03:04:05Z", archive_address=AWAY, copies=copies, note=self.note
        )

    def ListNodes(self, request, context):
        return node_service_pb2.ListNodesResponse()

    def GetSession(self, request, context):
        views = []
        for camera in self.cameras:
            view = self.session()
            view.name, view.view_of, view.view_camera = f"vase.{camera}", "vase", camera
            if view.name == request.name:
                return session_service_pb2.GetSessionResponse(session=view)
            views.append(view)
        session = self.session()
        session.views.extend(views)
        return session_service_pb2.GetSessionResponse(session=session)

    def WatchSession(self, request, context):
        yield session_service_pb2.WatchSessionResponse(session=self.session())

    def ResumeSession(self, request, context):
        self.asked.append(request)
        self.states.pop(0)
        return session_service_pb2.ResumeSessionResponse(session=self.session())

    def FetchMatte(self, request, context):
        self.asked.append(request)
        context.abort(grpc.StatusCode.FAILED_PRECONDITION, "session vase: no tile is solved yet")

    def ReplicateSession(self, request, context):
        self.asked.append(request)
        for done in (1, 3):
            yield session_service_pb2.ReplicateSessionResponse(frames_done=done, frame_count=3, bytes_done=10 * done, byte_count=30)

    def GetManifest(self, request, context):
        manifest = archive_pb2.CaptureManifest(format_version=1, session=request.session)
        manifest.camera.width_px, manifest.camera.height_px = WIDTH, HEIGHT
        for step in range(FRAMES):
            file = self.file_name.format(step)
            checksum = f"xxh3:{_native.checksum(FILE):016x}"
            manifest.frames.add(file=file, object=step > 0, step=step, exposure_ms=4.0, checksum=checksum, size_bytes=self.size_bytes)
        return archive_service_pb2.GetManifestResponse(manifest=manifest)

    def ReadFile(self, request, context):
        yield archive_service_pb2.ReadFileResponse(chunk=FILE[:3])
        yield archive_service_pb2.ReadFileResponse(chunk=FILE[3:] + bytes(self.flip))

    def ReadRows(self, request, context):
        self.asked.append(request)
        steps = [int(pathlib.PurePosixPath(file).stem) for file in request.files]
        rows = CODES[steps, request.first_row : request.first_row + request.row_count].astype("<u2").tobytes()
        for at in range(0, len(rows) - self.cut, 7):
            chunk = bytearray(rows[at : at + 7])
            checksum = _native.checksum(bytes(chunk))
            chunk[0] ^= self.flip
            yield archive_service_pb2.ReadRowsResponse(offset_bytes=at, checksum=checksum, chunk=bytes(chunk))


class ArchivesTest(unittest.TestCase):
    def setUp(self) -> None:
        self.server = Server()
        self.addCleanup(self.server.server.stop, None)
        self.rig = glasswing.connect(self.server.address)
        self.addCleanup(self.rig.close)
        self.session = self.rig.session("vase")

    def test_frames_come_from_a_node_with_a_copy(self) -> None:
        frames = self.session.frames()
        self.assertEqual((len(frames), frames.shape), (FRAMES, (HEIGHT, WIDTH, 3)))
        self.assertEqual([frame.object for frame in frames], [False, True, True])
        for index, frame in enumerate(frames):
            np.testing.assert_array_equal(frame.read(), CODES[index])
        np.testing.assert_array_equal(frames[-1].read(), CODES[-1])
        self.assertEqual([frame.step for frame in frames[1:]], [1, 2])
        np.testing.assert_array_equal(frames.rows(1, 2), CODES[:, 1:3])
        np.testing.assert_array_equal(frames.pixel(4, 3), CODES[:, 3, 4])

    def test_what_lies_outside_of_a_frame(self) -> None:
        frames = self.session.frames()
        for ask in (lambda: frames.rows(3, 2), lambda: frames.rows(-1), lambda: frames.rows(0, 0), lambda: frames.pixel(5, 0)):
            self.assertRaises(glasswing.InvalidInput, ask)
        self.assertRaises(IndexError, lambda: frames[FRAMES])
        self.assertEqual([request for request in self.server.asked], [])

    def test_damage_on_the_way_is_noticed(self) -> None:
        frames = self.session.frames()
        self.server.flip = 1
        with self.assertRaisesRegex(glasswing.Damaged, "rows of session vase arrived damaged"):
            frames.pixel(0, 0)
        self.server.flip, self.server.cut = 0, 7
        with self.assertRaisesRegex(glasswing.Damaged, "of 90 bytes of session vase's rows"):
            frames.rows(0)

    def test_an_export_is_whole_or_not_there(self) -> None:
        with tempfile.TemporaryDirectory() as work:
            target = pathlib.Path(work, "vase")
            self.server.flip = 1
            with self.assertRaisesRegex(glasswing.Damaged, "frames/0.tif arrived damaged"):
                self.session.export(target)
            self.server.flip, self.server.file_name = 0, "../{}.tif"
            with self.assertRaisesRegex(glasswing.Damaged, "must be in frames/"):
                self.session.export(target)
            self.server.size_bytes = 1 << 50
            with self.assertRaisesRegex(glasswing.Refused, "vase would take 3377699720527872 bytes; its disk has"):
                self.session.export(target)
            self.server.size_bytes = len(FILE)
            self.assertEqual(list(pathlib.Path(work).iterdir()), [])
            self.server.file_name = "frames/{}.tif"
            self.session.export(target)
            self.assertEqual(sorted(file.read_bytes() for file in target.glob("frames/*.tif")), [FILE] * FRAMES)
            self.assertRaises(glasswing.AlreadyExists, self.session.export, target)
            self.server.states = [session_pb2.SESSION_STATE_PAUSED]
            with self.assertRaisesRegex(glasswing.Refused, "vase is paused; it must be captured"):
                self.session.export(pathlib.Path(work, "other"))

    def test_each_of_several_cameras_has_a_session(self) -> None:
        self.assertEqual((self.session.cameras(), self.session.info.camera), ((), ""))
        self.server.cameras = ["left", "right"]
        session = self.rig.session("vase")
        self.assertEqual(session.cameras(), ("left", "right"))
        self.assertEqual([view.name for view in session.info.views], ["vase.left", "vase.right"])
        right = session.camera("right")
        self.assertEqual((right.name, right.info.camera), ("vase.right", "right"))
        np.testing.assert_array_equal(right.frames()[0].read(), CODES[0])
        with self.assertRaisesRegex(glasswing.Refused, "several cameras; .*: left, right"):
            session.frames()
        with self.assertRaisesRegex(glasswing.InvalidInput, "no camera top; it has left, right"):
            session.camera("top")

    def test_a_session_is_copied_to_a_node(self) -> None:
        self.assertEqual(self.session.replicate("solver-2"), 30)
        self.assertEqual((self.server.asked[0].name, self.server.asked[0].node), ("vase", "solver-2"))
        self.assertEqual(self.session.info.copies, ("solver-2",))

    def test_a_draft_is_a_partial_matte(self) -> None:
        with self.assertRaisesRegex(glasswing.Refused, "no tile is solved yet"):
            self.session.draft()
        self.assertTrue(self.server.asked[0].partial)

    def test_a_failed_session_is_resumed_as_often_as_is_said(self) -> None:
        failed, done = session_pb2.SESSION_STATE_FAILED, session_pb2.SESSION_STATE_DONE
        self.server.states = [failed, failed, done]
        self.assertIs(self.session.wait(retries=2).state, glasswing.State.DONE)
        self.assertEqual(len(self.server.asked), 2)
        self.server.states, self.server.asked = [failed, failed, done], []
        with self.assertRaises(glasswing.Stopped):
            self.session.wait(retries=1)
        self.assertEqual(len(self.server.asked), 1)
        # A cancelled session stays cancelled.
        self.server.states, self.server.asked = [session_pb2.SESSION_STATE_CANCELLED, done], []
        with self.assertRaises(glasswing.Stopped):
            self.session.wait(retries=5)
        self.assertEqual(self.server.asked, [])

    def test_a_notebook_shows_a_session_with_the_words_of_others_escaped(self) -> None:
        self.server.note = "<script>alert(1)</script>"
        self.session.refresh()
        shown = self.session._repr_html_()
        self.assertIn("<td>vase</td>", shown)
        self.assertIn("&lt;script&gt;", shown)
        self.assertNotIn("<script", shown)

    def test_nodes_that_are_all_away_are_named(self) -> None:
        # In a process of its own: gRPC may leave a call open to a server that stopped in the caller's process.
        command = [sys.executable, __file__, "serve"]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as served:
            address = served.stdout.readline().strip()
            with glasswing.connect(address) as rig:
                frames = rig.session("vase").frames()
                served.kill()
                served.wait()
                with self.assertRaisesRegex(glasswing.Unavailable, f"node at {address} does not answer"):
                    frames.pixel(0, 0)


class NotebookPicturesTest(unittest.TestCase):
    def test_composites_show_themselves_and_other_arrays_do_not(self) -> None:
        picture = np.zeros((2, 3, 3), np.float32).view(glasswing.Picture)
        self.assertEqual(picture._repr_png_()[:4], b"\x89PNG")
        self.assertIsNone(picture[0]._repr_png_())
        self.assertIsNone(picture.mean(axis=2)._repr_png_())
        self.assertEqual((picture + 1.0)._repr_png_()[:4], b"\x89PNG")

    def test_an_error_map_shows_what_is_known(self) -> None:
        error = np.full((2, 2, 3), np.nan, np.float32).view(glasswing.ErrorMap)
        self.assertEqual(error._repr_png_()[:4], b"\x89PNG")
        error[0, 0] = 0.01
        with tempfile.TemporaryDirectory() as work:
            file = pathlib.Path(work, "error.png")
            file.write_bytes(error._repr_png_())
            np.testing.assert_array_equal(glasswing.read_picture(file)[0], [[1.0] * 3, [0.0] * 3])


if __name__ == "__main__":
    if sys.argv[1:] == ["serve"]:
        print(Server().address, flush=True)
        sys.stdin.read()  # until the caller ends
        sys.exit()
    unittest.main()
