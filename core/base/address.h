// HOST:PORT, as options and nodes name where a program listens.
#pragma once

#include <absl/status/statusor.h>
#include <netdb.h>

#include <memory>
#include <string>
#include <string_view>

namespace glasswing {

struct Address {
  std::string host;  // a name or a number; of IPv6 without brackets
  int port = 0;      // 0 to 65535
};

// IPv6 hosts stand in brackets: "[::1]:7440". INVALID_ARGUMENT says what `text` is, and what it must be.
absl::StatusOr<Address> parse_address(std::string_view text);
std::string text_of(const Address& address);

struct FreeSocketAddresses {
  void operator()(addrinfo* addresses) const { ::freeaddrinfo(addresses); }
};
using SocketAddresses = std::unique_ptr<addrinfo, FreeSocketAddresses>;  // at least one
// What sockets of TCP connect to, or with AI_PASSIVE in `flags` listen on. INVALID_ARGUMENT: no address, or
// its host has none; says so.
absl::StatusOr<SocketAddresses> socket_addresses(const std::string& text, int flags = 0);

}  // namespace glasswing
