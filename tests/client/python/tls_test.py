"""TLS connections to a server that authenticates its callers: what is refused, and the error messages."""

import concurrent.futures
import pathlib
import subprocess
import tempfile
import unittest

import grpc

import glasswing
from glasswing.v1 import (node_service_pb2, node_service_pb2_grpc, session_pb2, session_service_pb2,
                          session_service_pb2_grpc)


class Sessions(session_service_pb2_grpc.SessionServiceServicer):
    def ListSessions(self, request, context):
        session = session_pb2.Session(name="vase", state=session_pb2.SESSION_STATE_DONE,
                                              created="2026-01-02T03:04:05Z")
        return session_service_pb2.ListSessionsResponse(sessions=[session])


class Nodes(node_service_pb2_grpc.NodeServiceServicer):
    def ListNodes(self, request, context):
        return node_service_pb2.ListNodesResponse()


def openssl(*arguments: str) -> None:
    subprocess.run(["openssl", *arguments], check=True, capture_output=True, timeout=60)


class Authority:
    """A certificate authority with its files in `directory`."""

    def __init__(self, directory: pathlib.Path, name: str) -> None:
        self.directory, self.name = directory, name
        self.certificate, self.key = directory / f"{name}.pem", directory / f"{name}.key"
        openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1",
                "-subj", f"/CN={name}", "-keyout", str(self.key), "-out", str(self.certificate))

    def issue(self, subject: str, name: str = "localhost") -> tuple[pathlib.Path, pathlib.Path]:
        """A certificate for the host `name` and its key."""
        stem = self.directory / f"{self.name}-{subject}"
        certificate, key, request = (stem.with_suffix(suffix) for suffix in (".pem", ".key", ".csr"))
        extension = stem.with_suffix(".ext")
        extension.write_text(f"subjectAltName=DNS:{name}\n")
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", f"/CN={subject}",
                "-keyout", str(key), "-out", str(request))
        openssl("x509", "-req", "-in", str(request), "-CA", str(self.certificate), "-CAkey", str(self.key),
                "-CAcreateserial", "-days", "1", "-extfile", str(extension), "-out", str(certificate))
        return certificate, key


class TlsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(directory.cleanup)
        cls.ours = Authority(pathlib.Path(directory.name), "ours")
        cls.foreign = Authority(pathlib.Path(directory.name), "foreign")
        cls.certificate, cls.key = cls.ours.issue("client")
        cls.address = f"localhost:{cls.serve('localhost')}"

    @classmethod
    def serve(cls, host: str) -> int:
        """Starts a server with a certificate for `host` that requires one of ours, and returns its port."""
        certificate, key = cls.ours.issue(f"server-{host}", host)
        credentials = grpc.ssl_server_credentials([(key.read_bytes(), certificate.read_bytes())],
                                                  root_certificates=cls.ours.certificate.read_bytes(),
                                                  require_client_auth=True)
        server = grpc.server(concurrent.futures.ThreadPoolExecutor(2))
        session_service_pb2_grpc.add_SessionServiceServicer_to_server(Sessions(), server)
        node_service_pb2_grpc.add_NodeServiceServicer_to_server(Nodes(), server)
        port = server.add_secure_port("localhost:0", credentials)
        server.start()
        cls.addClassCleanup(lambda: server.stop(None).wait())
        return port

    def refused(self, words: str, kind: type[glasswing.Error], *where: str, **files) -> None:
        with self.assertRaises(kind) as caught:
            glasswing.connect(*(where or (self.address,)), **files)
        self.assertIn(words, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_both_sides_prove_who_they_are(self):
        with glasswing.connect(self.address, ca=self.ours.certificate, certificate=self.certificate, key=self.key) as rig:
            self.assertEqual([session.name for session in rig.sessions()], ["vase"])

    def test_a_client_without_certificate_is_refused(self):
        self.refused("wants to know who calls", glasswing.Unavailable, ca=self.ours.certificate)

    def test_a_client_of_a_foreign_authority_is_refused(self):
        certificate, key = self.foreign.issue("client")
        self.refused("refuses the certificate", glasswing.Unavailable, ca=self.ours.certificate,
                     certificate=certificate, key=key)

    def test_a_server_of_a_foreign_authority_is_not_believed(self):
        self.refused("did not sign", glasswing.Unavailable, ca=self.foreign.certificate,
                     certificate=self.certificate, key=self.key)

    def test_a_server_of_another_name_is_not_believed(self):
        self.refused("of another host", glasswing.Unavailable, f"localhost:{self.serve('elsewhere')}",
                     ca=self.ours.certificate, certificate=self.certificate, key=self.key)

    def test_a_server_that_wants_tls_does_not_answer_without(self):
        self.refused("does not answer", glasswing.Unavailable)

    def test_a_server_without_tls_is_told(self):
        server = grpc.server(concurrent.futures.ThreadPoolExecutor(1))
        port = server.add_insecure_port("localhost:0")
        server.start()
        self.addCleanup(lambda: server.stop(None).wait())
        self.refused("does not speak TLS", glasswing.Unavailable, f"localhost:{port}", ca=self.ours.certificate)


if __name__ == "__main__":
    unittest.main()
