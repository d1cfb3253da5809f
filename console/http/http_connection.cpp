#include "console/http/http_connection.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <openssl/err.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace glasswing {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLook(100);      // between two checks of `give_up`
constexpr size_t kMaxTaken = 16 << 20;  // bytes that are dropped at the end

}  // namespace

HttpConnection::HttpConnection(int socket, SSL_CTX* tls)
    : socket_(socket), ssl_(tls == nullptr ? nullptr : SSL_new(tls)) {
  ::fcntl(socket_, F_SETFL, ::fcntl(socket_, F_GETFL) | O_NONBLOCK);
  if (ssl_ == nullptr) return;
  SSL_set_fd(ssl_.get(), socket_);
  SSL_set_mode(ssl_.get(), SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_ENABLE_PARTIAL_WRITE);
}

bool HttpConnection::wait(short events, Clock::time_point deadline) const {
  for (;;) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now()).count();
    pollfd look{.fd = socket_, .events = events, .revents = 0};
    const int ready = ::poll(&look, 1, static_cast<int>(std::clamp<long>(left, 0, 1 << 30)));
    if (ready < 0 && errno == EINTR) continue;
    return ready > 0;
  }
}

int HttpConnection::run(const std::function<int()>& operation, Clock::time_point deadline) {
  for (;;) {
    ERR_clear_error();
    const int result = operation();
    if (result > 0) return result;
    const int error = SSL_get_error(ssl_.get(), result);
    if (error == SSL_ERROR_ZERO_RETURN) return 0;
    if (error != SSL_ERROR_WANT_READ && error != SSL_ERROR_WANT_WRITE) return -1;
    if (!wait(error == SSL_ERROR_WANT_READ ? POLLIN : POLLOUT, deadline)) return -1;
  }
}

bool HttpConnection::shake_hands(Clock::time_point deadline) {
  return ssl_ == nullptr || run([this] { return SSL_accept(ssl_.get()); }, deadline) == 1;
}

bool HttpConnection::wait_for_request(Clock::time_point deadline, const std::function<bool()>& give_up) {
  while (begin_ == end_ && Clock::now() < deadline && !give_up()) {
    if (ssl_ != nullptr && SSL_pending(ssl_.get()) > 0) return true;
    if (wait(POLLIN, std::min(deadline, Clock::now() + kLook))) return true;
  }
  return begin_ < end_;
}

ssize_t HttpConnection::receive(char* bytes, size_t size, Clock::time_point deadline) {
  if (ssl_ != nullptr) {
    return run([&] { return SSL_read(ssl_.get(), bytes, static_cast<int>(size)); }, deadline);
  }
  for (;;) {
    const ssize_t got = ::recv(socket_, bytes, size, 0);
    if (got >= 0) return got;
    if (errno == EINTR) continue;
    if ((errno != EAGAIN && errno != EWOULDBLOCK) || !wait(POLLIN, deadline)) return -1;
  }
}

ssize_t HttpConnection::read(char* bytes, size_t size, Clock::time_point deadline) {
  if (begin_ == end_) {
    if (Clock::now() >= deadline) return -1;
    const ssize_t got = receive(buffer_.data(), buffer_.size(), deadline);
    if (got <= 0) return got;
    begin_ = 0;
    end_ = static_cast<size_t>(got);
  }
  const size_t taken = std::min(size, end_ - begin_);
  std::memcpy(bytes, &buffer_[begin_], taken);
  begin_ += taken;
  return static_cast<ssize_t>(taken);
}

ssize_t HttpConnection::write(const char* bytes, size_t size, Clock::time_point deadline) {
  if (ssl_ != nullptr) {
    const size_t part = std::min<size_t>(size, 1 << 20);
    return run([&] { return SSL_write(ssl_.get(), bytes, static_cast<int>(part)); }, deadline);
  }
  for (;;) {
    const ssize_t sent = ::send(socket_, bytes, size, MSG_NOSIGNAL);
    if (sent >= 0) return sent;
    if (errno == EINTR) continue;
    if ((errno != EAGAIN && errno != EWOULDBLOCK) || !wait(POLLOUT, deadline)) return -1;
  }
}

bool HttpConnection::is_writable() const {
  pollfd look{.fd = socket_, .events = POLLOUT, .revents = 0};
  if (::poll(&look, 1, 0) <= 0 || (look.revents & (POLLERR | POLLHUP)) != 0) return false;
  char next = 0;
  return ::recv(socket_, &next, 1, MSG_PEEK | MSG_DONTWAIT) != 0;
}

void HttpConnection::close(Clock::time_point deadline) {
  if (ssl_ != nullptr) SSL_shutdown(ssl_.get());
  ::shutdown(socket_, SHUT_WR);
  for (size_t taken = 0; taken < kMaxTaken && Clock::now() < deadline && wait(POLLIN, deadline);) {
    const ssize_t got = ::recv(socket_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (got <= 0) return;
    taken += static_cast<size_t>(got);
  }
}

std::string peer_address(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (::getpeername(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return "";
  if (address.ss_family == AF_INET) {
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in&>(address).sin_addr, text.data(), text.size());
  } else if (address.ss_family == AF_INET6) {
    ::inet_ntop(AF_INET6, &reinterpret_cast<const sockaddr_in6&>(address).sin6_addr, text.data(),
                text.size());
  }
  return text.data();
}

}  // namespace glasswing
