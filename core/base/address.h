// HOST:PORT, the form in which options and nodes give a program's address.
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

// IPv6 hosts are in brackets: "[::1]:7440". INVALID_ARGUMENT the message says what `text` is, and what it
// must be.
absl::StatusOr<Address> parse_address(std::string_view text);
std::string text_of(const Address& address);

struct FreeSocketAddresses {
  void operator()(addrinfo* addresses) const { ::freeaddrinfo(addresses); }
};
using SocketAddresses = std::unique_ptr<addrinfo, FreeSocketAddresses>;  // at least one
// The addresses to which TCP sockets connect, or on which they listen with AI_PASSIVE in `flags`.
// INVALID_ARGUMENT: not an address, or its host has none; the message says so.
absl::StatusOr<SocketAddresses> socket_addresses(const std::string& text, int flags = 0);

}  // namespace glasswing
