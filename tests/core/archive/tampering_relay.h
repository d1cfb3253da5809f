// Simulates a bad network: relays TCP to a node on this machine, and lets the test alter what the node sends.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <functional>
#include <list>
#include <mutex>
#include <string>
#include <thread>

namespace glasswing {

class TamperingRelay {
 public:
  // Called with each piece that the node sends and with the number of bytes that it sent before, over all
  // connections; false: the connection is cut instead.
  using Tamper = std::function<bool(std::string& bytes, size_t before)>;

  TamperingRelay(const std::string& target, Tamper tamper)
      : port_(std::stoi(target.substr(target.rfind(':') + 1))),
        tamper_(std::move(tamper)),
        listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(listener_, 8) != 0 ||
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      std::abort();
    address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    accepting_ = std::jthread([this](std::stop_token stop) { accept_all(stop); });
  }
  ~TamperingRelay() {
    accepting_ = {};
    passing_.clear();
    ::close(listener_);
  }
  const std::string& address() const { return address_; }
  size_t sent() const { return sent_; }          // by the node
  size_t received() const { return received_; }  // by the node

 private:
  static sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    return address;
  }
  static bool ready(int fd) {
    pollfd ready{.fd = fd, .events = POLLIN, .revents = 0};
    return ::poll(&ready, 1, 20) > 0;
  }
  void accept_all(std::stop_token stop) {
    while (!stop.stop_requested()) {
      if (!ready(listener_)) continue;
      const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      passing_.emplace_back([this, client](std::stop_token ending) { pass(client, ending); });
    }
  }
  void pass(int client, std::stop_token stop) {
    const int node = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in address = loopback(port_);
    std::array<char, 1 << 16> buffer{};
    bool open = ::connect(node, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    while (open && !stop.stop_requested()) {
      std::array<pollfd, 2> either{{{client, POLLIN, 0}, {node, POLLIN, 0}}};
      if (::poll(either.data(), either.size(), 20) <= 0) continue;
      for (const int from : {client, node}) {
        if (either[from == node ? 1 : 0].revents == 0) continue;
        const ssize_t got = ::recv(from, buffer.data(), buffer.size(), 0);
        std::string bytes(buffer.data(), std::max<ssize_t>(got, 0));
        open = open && got > 0 && (from == client || tamper_(bytes, sent_));
        (from == node ? sent_ : received_) += bytes.size();
        if (open && ::send(from == client ? node : client, bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0)
          open = false;
      }
    }
    ::close(client);
    ::close(node);
  }

  const int port_;
  const Tamper tamper_;
  const int listener_;
  std::string address_;
  std::atomic<size_t> sent_ = 0, received_ = 0;
  std::list<std::jthread> passing_;  // owned by the accepting thread; after its end, by the destructor
  std::jthread accepting_;
};

}  // namespace glasswing
