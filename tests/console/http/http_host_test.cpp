// The bounds of the console's HTTP, by sockets of our own: no client library sends such things.
#include "console/http/http_host.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <charconv>

#include "core/file/descriptor.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// A connection to the console. Nothing waits longer than kPatience.
class Wire {
 public:
  static constexpr timeval kPatience{.tv_sec = 30, .tv_usec = 0};

  explicit Wire(const std::string& address) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    std::uint16_t port = 0;
    const size_t colon = address.rfind(':');
    std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
    to.sin_port = htons(port);
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
    EXPECT_EQ(::connect(socket_.get(), reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
  }
  // False: the other end has closed.
  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      bytes.remove_prefix(sent);
    }
    return true;
  }
  // The status of the next answer, which is read to its end; 0: the other end has closed.
  int status() {
    size_t head = 0, body = 0;
    while ((head = received_.find("\r\n\r\n")) == std::string::npos)
      if (!receive()) return 0;
    constexpr std::string_view kLength = "Content-Length: ";
    if (const size_t at = received_.find(kLength); at < head)
      std::from_chars(&received_[at + kLength.size()], &received_[head], body);
    while (received_.size() < head + 4 + body)
      if (!receive()) return 0;
    int status = 0;
    std::from_chars(&received_[9], &received_[12], status);
    says_close_ = received_.find("\r\nConnection: close\r\n") < head;
    received_.erase(0, head + 4 + body);
    return status;
  }
  int status_of(std::string_view request) { return send(request) ? status() : 0; }
  // Whether the last answer says that no other will come.
  bool says_close() const { return says_close_; }

 private:
  bool receive() {
    char bytes[4096];
    const ssize_t got = ::recv(socket_.get(), bytes, sizeof bytes, 0);
    if (got > 0) received_.append(bytes, got);
    return got > 0;
  }

  const Descriptor socket_;
  std::string received_;
  bool says_close_ = false;
};

class HttpHostTest : public testing::Test {
 protected:
  void start(const HttpLimits& limits = {}) {
    host_ = HttpHost::bind("127.0.0.1:0", limits).value();
    host_->limit_bodies(
        [](const std::string& path) { return path == "/small" ? std::optional<size_t>(100) : std::nullopt; });
    host_->routes().Get("/here", [](const httplib::Request&, httplib::Response& response) {
      response.set_content("here", "text/plain");
    });
    host_->routes().Post("/small", [](const httplib::Request&, httplib::Response& response,
                                      const httplib::ContentReader& content) {
      std::string body;
      content([&](const char* bytes, size_t size) {
        body.append(bytes, size);
        return true;
      });
      response.set_content(body, "text/plain");
    });
    host_->serve();
  }
  Wire wire() const { return Wire(host_->address()); }
  static std::string get(const std::string& headers = "") {
    return "GET /here HTTP/1.1\r\nHost: x\r\n" + headers + "\r\n";
  }
  static std::string post(const std::string& path, const std::string& headers, const std::string& body = "") {
    return "POST " + path + " HTTP/1.1\r\nHost: x\r\n" + headers + "\r\n" + body;
  }

  std::unique_ptr<HttpHost> host_;
};

TEST_F(HttpHostTest, OrdinaryRequestsShareAConnection) {
  start();
  Wire browser = wire();
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(browser.status_of(get()), 200);
    EXPECT_EQ(browser.status_of(post("/small", "Content-Length: 5\r\n", "12345")), 200);
    EXPECT_FALSE(browser.says_close());
  }
}

TEST_F(HttpHostTest, AHeadWithoutEndIsCutOff) {
  start();
  // One line, many lines, lines without an end of theirs.
  for (const std::string& part :
       {std::string(1 << 16, 'x'), std::string("A: b\r\n"), std::string("A: b\n")}) {
    Wire browser = wire();
    ASSERT_TRUE(browser.send("GET /here HTTP/1.1\r\n"));
    size_t sent = 0;
    while (sent < (64u << 20) && browser.send(part)) sent += part.size();
    EXPECT_LT(sent, 64u << 20) << part.substr(0, 10);
  }
  EXPECT_EQ(wire().status_of(get("A: b\r\n")), 200);
}

TEST_F(HttpHostTest, ABodyIsRefusedBeforeItIsRead) {
  start();
  EXPECT_EQ(wire().status_of(post("/small", "Content-Length: 101\r\n")), 413);
  EXPECT_EQ(wire().status_of(post("/small", "Content-Length: 100\r\nContent-Encoding: gzip\r\n")), 415);
  EXPECT_EQ(wire().status_of(post("/small", "Transfer-Encoding: chunked\r\n")), 411);
  EXPECT_EQ(wire().status_of(
                post("/small", "Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 9\r\n")),
            415);
  EXPECT_EQ(wire().status_of(post("/elsewhere", "Content-Length: 60000000\r\n")), 404);
  EXPECT_EQ(wire().status_of("PUT /small HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\n"), 405);
}

TEST_F(HttpHostTest, ABodyThatIsNotReadIsNeverTakenForARequest) {
  start();
  const auto expect_last = [&](const std::string& request, int status) {
    Wire browser = wire();
    EXPECT_EQ(browser.status_of(request + get()), status) << request;
    EXPECT_TRUE(browser.says_close()) << request;
    EXPECT_EQ(browser.status(), 0) << request;
  };
  expect_last(post("/small", "Content-Length: 500\r\n"), 413);
  expect_last(post("/small", "Transfer-Encoding: chunked\r\n"), 411);
  expect_last(get("Content-Length: 500\r\n"), 200);
  expect_last(get("Transfer-Encoding: chunked\r\n"), 200);
}

TEST_F(HttpHostTest, ASlowHeadLosesItsPlace) {
  start({.threads = 1, .head = milliseconds(200)});
  Wire slow = wire();
  ASSERT_TRUE(slow.send("GET /he"));
  EXPECT_EQ(wire().status_of(get()), 200);
  EXPECT_EQ(slow.status_of("re HTTP/1.1\r\n\r\n"), 0);
}

TEST_F(HttpHostTest, IdleConnectionsMakeRoomForThoseThatWait) {
  start({.threads = 1, .idle = std::chrono::hours(1)});
  Wire idle = wire();
  EXPECT_EQ(idle.status_of(get()), 200);
  EXPECT_EQ(wire().status_of(get()), 200);
}

TEST_F(HttpHostTest, BeyondTheirNumberConnectionsAreClosed) {
  start({.threads = 1, .waiting = 2, .idle = std::chrono::hours(1), .head = std::chrono::hours(1)});
  Wire served = wire();
  ASSERT_EQ(served.status_of(get() + "GET /he"), 200);  // and keeps the only thread
  const Wire first = wire(), second = wire();           // wait
  for (int i = 0; i < 40; ++i) EXPECT_EQ(wire().status(), 0);
  EXPECT_EQ(served.status_of("re HTTP/1.1\r\nHost: x\r\n\r\n"), 200);
}

}  // namespace
}  // namespace glasswing
