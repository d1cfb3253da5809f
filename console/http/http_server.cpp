#include "console/http/http_server.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/file/descriptor.h"
#include "core/security/tls.h"

namespace glasswing {
namespace {

using Clock = HttpConnection::Clock;

constexpr std::chrono::seconds kClose(2);

// Set while a connection is accepted only to be closed.
thread_local bool is_refusing = false;

// Threads for connections, and a bounded number of those that wait for a thread.
class Threads final : public httplib::TaskQueue {
 public:
  Threads(const HttpLimits& limits, std::atomic<size_t>& waiting)
      : limit_(limits.waiting), waiting_(waiting), pool_(limits.threads) {}
  void enqueue(std::function<void()> serve) override {
    if (waiting_ >= limit_) {
      is_refusing = true;
      serve();
      is_refusing = false;
      return;
    }
    ++waiting_;
    pool_.enqueue([this, serve = std::move(serve)] {
      --waiting_;
      serve();
    });
  }
  void shutdown() override { pool_.shutdown(); }

 private:
  const size_t limit_;
  std::atomic<size_t>& waiting_;
  httplib::ThreadPool pool_;
};

// One request of a connection, as httplib reads it.
class RequestStream final : public httplib::Stream {
 public:
  RequestStream(HttpConnection& connection, const HttpLimits& limits)
      : connection_(connection), limits_(limits), deadline_(Clock::now() + limits.head) {}

  void begin_body(std::uint64_t size_bytes) {
    in_head_ = false;
    body_left_ = size_bytes;
    deadline_ = Clock::now() + limits_.body;
  }
  // False: the rest of the body would be read as the next request.
  bool is_read() const { return !in_head_ && body_left_ == 0; }

  ssize_t read(char* bytes, size_t size) override {
    if (in_head_ && (head_bytes_ >= limits_.head_bytes || head_lines_ > limits_.head_lines)) return -1;
    const Clock::time_point stalled = Clock::now() + limits_.stalled;
    const ssize_t got = connection_.read(bytes, size, std::min(deadline_, stalled));
    if (got <= 0) return got;
    const size_t count = got;
    if (in_head_) {
      head_bytes_ += count;
      head_lines_ += static_cast<size_t>(std::count(bytes, bytes + count, '\n'));
    } else {
      body_left_ -= std::min<std::uint64_t>(body_left_, count);
    }
    return got;
  }
  ssize_t write(const char* bytes, size_t size) override {
    return connection_.write(bytes, size, Clock::now() + limits_.stalled);
  }
  bool is_readable() const override { return true; }  // read() waits
  bool is_writable() const override { return connection_.is_writable(); }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    ip = peer_address(connection_.socket());
    port = 0;
  }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    ip.clear();
    port = 0;
  }
  socket_t socket() const override { return connection_.socket(); }

 private:
  HttpConnection& connection_;
  const HttpLimits& limits_;
  Clock::time_point deadline_;
  bool in_head_ = true;
  size_t head_bytes_ = 0, head_lines_ = 0;
  std::uint64_t body_left_ = 0;
};

// A body in chunks is never read to its end.
std::uint64_t body_bytes(const httplib::Request& request) {
  if (request.has_header("Transfer-Encoding")) return std::numeric_limits<std::uint64_t>::max();
  return request.get_header_value<std::uint64_t>("Content-Length");
}

// What this thread is reading.
thread_local const RequestStream* request_stream = nullptr;

}  // namespace

HttpServer::HttpServer(const HttpLimits& limits, SSL_CTX* tls) : limits_(limits), tls_(tls) {
  new_task_queue = [this] { return new Threads(limits_, waiting_); };
  // Otherwise a client might send its next request while the connection closes.
  set_post_routing_handler([](const httplib::Request&, httplib::Response& response) {
    if (!request_stream->is_read()) response.set_header("Connection", "close");
  });
}

HttpServer::~HttpServer() {
  SSL_CTX_free(tls_);
}

bool HttpServer::take_place(const std::string& address) {
  const std::lock_guard lock(mutex_);
  size_t& count = connections_[address];
  if (count >= limits_.connections_of_an_address && !is_loopback(address + ":0")) return false;
  ++count;
  return true;
}

void HttpServer::leave_place(const std::string& address) {
  const std::lock_guard lock(mutex_);
  const auto place = connections_.find(address);
  if (--place->second == 0) connections_.erase(place);
}

bool HttpServer::process_and_close_socket(socket_t socket) {
  const Descriptor open(socket);
  if (is_refusing) return false;
  const std::string address = peer_address(socket);
  if (!take_place(address)) return false;
  HttpConnection connection(socket, tls_);
  if (connection.shake_hands(Clock::now() + limits_.handshake)) serve(connection);
  leave_place(address);
  return true;
}

void HttpServer::serve(HttpConnection& connection) {
  const auto others_wait = [this] { return waiting_ > 0 || svr_sock_ == INVALID_SOCKET; };
  for (size_t left = keep_alive_max_count_; left > 0; --left) {
    const bool is_first = left == keep_alive_max_count_;
    const bool comes = connection.wait_for_request(
        Clock::now() + limits_.idle, [&] { return is_first ? svr_sock_ == INVALID_SOCKET : others_wait(); });
    if (!comes) break;
    RequestStream stream(connection, limits_);
    request_stream = &stream;
    bool is_closed = false;
    const bool is_answered = process_request(stream, left == 1, is_closed, [&](httplib::Request& request) {
      request.ssl = connection.ssl();
      // Many ranges of one file would make an answer of many times its size.
      if (request.ranges.size() > 1) request.ranges.clear();
      stream.begin_body(body_bytes(request));
    });
    if (!is_answered || is_closed || !stream.is_read()) break;
  }
  connection.close(Clock::now() + kClose);
}

}  // namespace glasswing
