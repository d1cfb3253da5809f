"""The messages and services of proto/glasswing/v1, as protoc wrote them when Glasswing was built."""
