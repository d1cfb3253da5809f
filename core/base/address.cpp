#include "core/base/address.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "core/base/status.h"

namespace glasswing {
namespace {

std::optional<int> port_in(std::string_view text) {
  int port = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port < 0 || port > 65535)
    return std::nullopt;
  return port;
}

bool is_host(std::string_view host, bool bracketed) {
  return !host.empty() && std::ranges::all_of(host, [bracketed](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == '_' ||
           (bracketed && (c == ':' || c == '%'));
  });
}

}  // namespace

absl::StatusOr<Address> parse_address(std::string_view text) {
  const size_t colon = text.rfind(':');
  if (colon != std::string_view::npos) {
    std::string_view host = text.substr(0, colon);
    const bool bracketed = host.starts_with('[') && host.ends_with(']');
    if (bracketed) host = host.substr(1, host.size() - 2);
    const std::optional<int> port = port_in(text.substr(colon + 1));
    if (port && is_host(host, bracketed)) return Address{.host = std::string(host), .port = *port};
  }
  return absl::InvalidArgumentError(
      fmt::format("the address is \"{}\"; it must be HOST:PORT, such as 127.0.0.1:7440 or [::1]:7440", text));
}

std::string text_of(const Address& address) {
  return address.host.find(':') == std::string::npos ? fmt::format("{}:{}", address.host, address.port)
                                                     : fmt::format("[{}]:{}", address.host, address.port);
}

absl::StatusOr<SocketAddresses> socket_addresses(const std::string& text, int flags) {
  GW_ASSIGN_OR_RETURN(const Address at, parse_address(text));
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int failed = ::getaddrinfo(at.host.c_str(), std::to_string(at.port).c_str(), &hints, &found);
  if (failed != 0) {
    return absl::InvalidArgumentError(
        fmt::format("host \"{}\" has no address: {}", at.host, ::gai_strerror(failed)));
  }
  return SocketAddresses(found);
}

}  // namespace glasswing
