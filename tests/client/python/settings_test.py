"""The sources of the server's address and the certificates, and which connections are refused, or end."""

import contextlib
import os
import pathlib
import socket
import tempfile
import threading
import unittest
import unittest.mock

import glasswing
from glasswing.connection import Connection
from glasswing.settings import load_settings
from glasswing.v1 import session_service_pb2, session_service_pb2_grpc


class SettingsTest(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.home = pathlib.Path(directory.name)
        self.file = self.home / "glasswing/config.toml"
        self.file.parent.mkdir()
        self.environment({})

    def environment(self, variables: dict[str, str]) -> None:
        patch = unittest.mock.patch.dict(os.environ, {"XDG_CONFIG_HOME": str(self.home), **variables}, clear=True)
        patch.start()
        self.addCleanup(patch.stop)

    def test_without_any_it_is_this_machine(self):
        settings = load_settings(None, None, None, None)
        self.assertEqual((settings.server, settings.ca), ("127.0.0.1:7440", None))

    def test_what_is_given_goes_before_the_environment_and_that_before_the_file(self):
        self.file.write_text('server = "file:1"\nca = "ca.pem"\nkey = "/keys/me.key"\ncolor = "never"\n')
        settings = load_settings(None, None, None, None)
        self.assertEqual((settings.server, settings.ca), ("file:1", self.file.parent / "ca.pem"))
        self.assertEqual((settings.certificate, settings.key), (None, pathlib.Path("/keys/me.key")))
        self.environment({"GLASSWING_SERVER": "variable:2", "GLASSWING_CA": "here.pem"})
        settings = load_settings(None, None, None, None)
        self.assertEqual((settings.server, settings.ca), ("variable:2", pathlib.Path("here.pem")))
        self.assertEqual(load_settings("given:3", None, None, None).server, "given:3")

    def refused(self, kind: type[glasswing.Error], words: str, *arguments, **named) -> None:
        with self.assertRaises(kind) as caught:
            glasswing.connect(*arguments, **named)
        self.assertIn(words, str(caught.exception))

    def test_a_file_that_is_wrong_is_named(self):
        self.file.write_text('server = "a"\nport = "7440"\n')
        self.refused(glasswing.InvalidInput, "config.toml: there is no key port; there are server, ca,")
        self.file.write_text("server = 7440\n")
        self.refused(glasswing.InvalidInput, "config.toml: server is 7440; it must be text")
        self.file.write_text("server\n")
        self.refused(glasswing.InvalidInput, "config.toml: ")
        self.environment({"GLASSWING_CONFIG": "/nonexistent/file"})
        self.refused(glasswing.NotFound, "/nonexistent/file")

    def test_a_call_to_a_machine_that_vanished_ends(self):
        with socket.create_server(("127.0.0.1", 0)) as listener, contextlib.ExitStack() as connections:

            def accept() -> None:
                peer = connections.enter_context(listener.accept()[0])
                peer.sendall(bytes([0, 0, 0, 4, 0, 0, 0, 0, 0]))  # HTTP/2's first frame, of settings, and nothing after it

            peer = threading.Thread(target=accept)
            peer.start()
            settings = load_settings(f"127.0.0.1:{listener.getsockname()[1]}", None, None, None)
            connection = Connection(settings, timeout=90.0)
            self.addCleanup(connection.close)
            get = connection.stub(session_service_pb2_grpc.SessionServiceStub).GetSession
            with self.assertRaises(glasswing.Unavailable) as caught:
                connection.call(get, session_service_pb2.GetSessionRequest(name="s"))
            self.assertIn("does not answer", str(caught.exception))
            peer.join()

    def test_another_machine_needs_tls(self):
        for server in ("rig.example:7440", "10.0.0.7:7440", "[2001:db8::1]:7440", "127.example.org:7440"):
            self.refused(glasswing.InvalidInput, f"server is {server}, another machine, which needs TLS", server)

    def test_certificates_that_cannot_be(self):
        self.refused(glasswing.NotFound, "ca is none.pem", ca="none.pem")
        self.refused(glasswing.InvalidInput, "must be a PEM file", ca=__file__.replace("settings_test", "plan_test"))
        self.refused(glasswing.InvalidInput, "give both or neither", ca="ca.pem", certificate="me.pem")
        self.refused(glasswing.InvalidInput, "need a ca", certificate="me.pem", key="me.key")


if __name__ == "__main__":
    unittest.main()
