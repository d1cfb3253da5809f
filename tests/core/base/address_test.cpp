#include "core/base/address.h"

#include <gtest/gtest.h>
#include <netinet/in.h>

#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST(Address, IsReadAndWrittenBack) {
  const auto check = [](const std::string& text, const std::string& host, int port) {
    const absl::StatusOr<Address> address = parse_address(text);
    ASSERT_OK(address);
    EXPECT_EQ(address->host, host);
    EXPECT_EQ(address->port, port);
    EXPECT_EQ(text_of(*address), text);
  };
  check("127.0.0.1:7440", "127.0.0.1", 7440);
  check("rig-2.lab_a:0", "rig-2.lab_a", 0);
  check("[::1]:65535", "::1", 65535);
  check("[fe80::1%eth0]:80", "fe80::1%eth0", 80);
}

TEST(Address, AnythingElseIsRefusedByName) {
  for (const char* text :
       {"", ":", "127.0.0.1", "127.0.0.1:", ":80", "127.0.0.1:80x", "127.0.0.1:-1", "127.0.0.1:65536",
        "127.0.0.1:99999999999", "127.0.0.1: 80", "::1:80", "[::1]", "[]:80", "[::1:80", "unix:/run/x:80",
        "unix:80 ", "dns:///a:80", "a b:80", "a/b:80"}) {
    const absl::Status status = parse_address(text).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << text;
    EXPECT_NE(status.message().find(text), std::string::npos) << status;
  }
}

TEST(Address, LeadsToSockets) {
  const absl::StatusOr<SocketAddresses> six = socket_addresses("[::1]:7440");
  ASSERT_OK(six);
  ASSERT_EQ((*six)->ai_family, AF_INET6);
  EXPECT_EQ(reinterpret_cast<const sockaddr_in6*>((*six)->ai_addr)->sin6_port, htons(7440));
  EXPECT_TRUE(absl::IsInvalidArgument(socket_addresses("127.0.0.1:80x").status()));
  const absl::Status nowhere = socket_addresses("no-host.invalid:80").status();
  EXPECT_NE(nowhere.message().find("host \"no-host.invalid\" has no address"), std::string::npos) << nowhere;
}

}  // namespace
}  // namespace glasswing
