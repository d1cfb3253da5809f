// How many packets the kernel holds in a socket's buffer of the size that AravisRun asks for.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <vector>

#include "camera-node/backends/aravis/aravis_run.h"

namespace glasswing {
namespace {

constexpr size_t kFrame_bytes = 900'000;
constexpr size_t kHeaders_bytes = 28;  // IP's and UDP's in a packet

TEST(SocketBuffer, HoldsTheFramesThatItIsMeantFor) {
  for (const size_t packet_bytes : {576, 1400, 1500, 4000, 7500, 8000, 9000, 15000}) {
    SCOPED_TRACE(testing::Message() << "packets of " << packet_bytes << " bytes");
    const int to = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0),
              from = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const size_t wanted = wanted_socket_bytes(kFrame_bytes, packet_bytes);
    const int set = static_cast<int>(wanted);
    ASSERT_EQ(::setsockopt(to, SOL_SOCKET, SO_RCVBUF, &set, sizeof set), 0);
    int doubled = 0;
    socklen_t size = sizeof doubled;
    ASSERT_EQ(::getsockopt(to, SOL_SOCKET, SO_RCVBUF, &doubled, &size), 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof at;
    ASSERT_EQ(::bind(to, reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
    ASSERT_EQ(::getsockname(to, reinterpret_cast<sockaddr*>(&at), &length), 0);
    const std::vector<std::uint8_t> packet(packet_bytes - kHeaders_bytes);
    const size_t of_a_frame = kFrame_bytes / packet_bytes + 1;
    for (size_t i = 0; i < 4 * kSocketFrames * of_a_frame; ++i) {
      ASSERT_EQ(
          ::sendto(from, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&at), length),
          static_cast<ssize_t>(packet.size()));
    }
    size_t held = 0;
    std::uint8_t byte = 0;
    while (::recv(to, &byte, 1, MSG_DONTWAIT) >= 0) ++held;
    ::close(to);
    ::close(from);
    // The kernel may allow less than was asked for.
    const double frames = static_cast<double>(held) / static_cast<double>(of_a_frame),
                 share = doubled / 2.0 / static_cast<double>(wanted);
    EXPECT_GE(frames, kSocketFrames * share - 1.0 / static_cast<double>(of_a_frame));
    EXPECT_LE(frames, 2 * kSocketFrames * share + 1.0);
  }
}

}  // namespace
}  // namespace glasswing
