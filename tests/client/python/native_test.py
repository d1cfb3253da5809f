"""The C++ module beside Python's protobuf and gRPC: both have the messages of proto/ in one libprotobuf. A clash of
descriptors ends the process, so each order of loading runs in its own."""

import itertools
import subprocess
import sys
import unittest

MODULES = ("glasswing._native", "glasswing.v1.matte_pb2", "glasswing.v1.session_service_pb2_grpc")
USE = """
import glasswing._native as native
from glasswing.errors import Damaged
from glasswing.v1 import archive_pb2, matte_pb2, plan_pb2, session_service_pb2
metadata = matte_pb2.MatteMetadata(session="s", monitors=[archive_pb2.Monitor(name="back")])
assert matte_pb2.MatteMetadata.FromString(metadata.SerializeToString()).monitors[0].name == "back"
request = session_service_pb2.CreateSessionRequest(plan=plan_pb2.Plan(method="alpha"))
assert session_service_pb2.CreateSessionRequest.FromString(request.SerializeToString()).plan.method == "alpha"
try:
    native.NativeMatte.decode(b"no matte")
except Damaged:
    print("well")
"""


class NativeTest(unittest.TestCase):
    def test_another_python_is_named(self):
        for lacking in ("google", "grpc", "numpy"):
            program = f"import sys\nsys.modules['{lacking}'] = None\nimport glasswing"
            done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
            self.assertIn("glasswing runs in Debian's Python, /usr/bin/python3, with its python3-grpcio", done.stderr)
            self.assertIn(lacking, done.stderr.splitlines()[-1])
            self.assertTrue(done.stderr.splitlines()[-1].endswith(sys.executable), done.stderr)

    def test_every_order_of_loading(self):
        for order in itertools.permutations(MODULES):
            with self.subTest(order=order):
                program = "import importlib\n" + "".join(f"importlib.import_module('{name}')\n" for name in order) + USE
                done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
                self.assertEqual((done.stdout, done.stderr, done.returncode), ("well\n", "", 0))


if __name__ == "__main__":
    unittest.main()
