// One browser's connection, plain or TLS, with a deadline for everything that its peer does.
#pragma once

#include <httplib.h>
#include <openssl/ssl.h>

#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

namespace glasswing {

class HttpConnection {
 public:
  using Clock = std::chrono::steady_clock;

  // Borrows the socket. `tls`: null for plain HTTP.
  HttpConnection(int socket, SSL_CTX* tls);

  // True without TLS too. False: it failed, or was not done by then.
  bool shake_hands(Clock::time_point deadline);
  // Waits for the first byte of a request. False: closed, `give_up`, or none came by then.
  bool wait_for_request(Clock::time_point deadline, const std::function<bool()>& give_up);
  // Like read(2) and write(2); -1 after the deadline too.
  ssize_t read(char* bytes, size_t size, Clock::time_point deadline);
  ssize_t write(const char* bytes, size_t size, Clock::time_point deadline);
  // False: the peer has gone, or accepts nothing now.
  bool is_writable() const;
  // Closes in order: receives what the peer still sends for a while, so that it can read the last answer.
  void close(Clock::time_point deadline);

  SSL* ssl() const { return ssl_.get(); }
  int socket() const { return socket_; }

 private:
  struct Free {
    void operator()(SSL* ssl) const { SSL_free(ssl); }
  };
  bool wait(short events, Clock::time_point deadline) const;
  // Repeats a TLS operation until it neither wants to read nor to write.
  int run(const std::function<int()>& operation, Clock::time_point deadline);
  ssize_t receive(char* bytes, size_t size, Clock::time_point deadline);

  const int socket_;
  const std::unique_ptr<SSL, Free> ssl_;
  std::array<char, 16384> buffer_;  // received bytes [begin_, end_) that were not read
  size_t begin_ = 0, end_ = 0;
};

// "192.0.2.7", of the other end.
std::string peer_address(int socket);

}  // namespace glasswing
