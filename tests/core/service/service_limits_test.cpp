#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>

#include "core/file/descriptor.h"
#include "core/service/service.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// Sends a matte that never ends, and takes pictures that never end.
class Streams final : public v1::SessionService::Service {
 public:
  std::atomic<int> ended = 0;

 private:
  grpc::Status FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest*,
                          grpc::ServerWriter<v1::FetchMatteResponse>* writer) override {
    v1::FetchMatteResponse response;
    response.set_chunk(std::string(kChunkBytes, 'm'));
    while (writer->Write(response)) {
    }
    ++ended;
    return grpc::Status::OK;
  }
  grpc::Status UploadImage(grpc::ServerContext*, grpc::ServerReader<v1::UploadImageRequest>* reader,
                           v1::UploadImageResponse*) override {
    v1::UploadImageRequest request;
    while (reader->Read(&request)) {
    }
    ++ended;
    return grpc::Status::OK;
  }
};

bool until(const std::function<bool()>& what) {
  const auto most = std::chrono::steady_clock::now() + seconds(20);
  while (!what()) {
    if (std::chrono::steady_clock::now() > most) return false;
    std::this_thread::sleep_for(milliseconds(2));
  }
  return true;
}

int port_of(const ServiceHost& host) {
  return std::stoi(host.address().substr(host.address().rfind(':') + 1));
}

Descriptor unconnected() {
  Descriptor connection(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const timeval most{.tv_sec = 20, .tv_usec = 0};
  ::setsockopt(connection.get(), SOL_SOCKET, SO_RCVTIMEO, &most, sizeof most);
  return connection;
}

void connect_to(const ServiceHost& host, const Descriptor& connection) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port_of(host)));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(::connect(connection.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
}

Descriptor connected_to(const ServiceHost& host) {
  Descriptor connection = unconnected();
  connect_to(host, connection);
  return connection;
}

// Reads until the other side closes; false if it does not.
bool is_closed(const Descriptor& connection) {
  char byte[256];
  ssize_t got = 0;
  while ((got = ::recv(connection.get(), byte, sizeof byte, 0)) > 0) {
  }
  return got == 0 || errno == ECONNRESET;
}

bool answers(const ServiceHost& host) {
  const auto stub = v1::ClockService::NewStub(dial(host.address()));
  grpc::ClientContext context;
  set_deadline(context, seconds(10));
  v1::ExchangeResponse response;
  return stub->Exchange(&context, {}, &response).ok();
}

int highest_descriptor() {
  int highest = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
    highest = std::max(highest, std::stoi(entry.path().filename().string()));
  return highest;
}

TEST(ServiceLimits, AReaderThatHasStoppedLosesItsCall) {
  Streams streams;
  const auto host = ServiceHost::start({.limits = {.stalled = milliseconds(200)}}, {&streams}).value();
  const auto stub = v1::SessionService::NewStub(dial(host->address()));
  grpc::ClientContext context;
  set_deadline(context, seconds(20));
  const auto reader = stub->FetchMatte(&context, {});
  v1::FetchMatteResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_TRUE(until([&] { return streams.ended == 1; }));  // nobody reads
  EXPECT_TRUE(answers(*host));
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST(ServiceLimits, AReaderThatReadsKeepsItsCall) {
  Streams streams;
  const auto host = ServiceHost::start({.limits = {.stalled = milliseconds(500)}}, {&streams}).value();
  const auto stub = v1::SessionService::NewStub(dial(host->address()));
  grpc::ClientContext context;
  set_deadline(context, seconds(20));
  const auto reader = stub->FetchMatte(&context, {});
  v1::FetchMatteResponse response;
  const auto most = std::chrono::steady_clock::now() + milliseconds(1500);
  while (std::chrono::steady_clock::now() < most) ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(streams.ended, 0);
  context.TryCancel();
  (void)reader->Finish();
}

TEST(ServiceLimits, AWriterThatHasStoppedLosesItsCall) {
  Streams streams;
  const auto host = ServiceHost::start({.limits = {.stalled = milliseconds(200)}}, {&streams}).value();
  const auto stub = v1::SessionService::NewStub(dial(host->address()));
  grpc::ClientContext context;
  set_deadline(context, seconds(20));
  v1::UploadImageResponse response;
  const auto writer = stub->UploadImage(&context, &response);
  v1::UploadImageRequest request;
  request.set_chunk("a beginning");
  ASSERT_TRUE(writer->Write(request));
  EXPECT_TRUE(until([&] { return streams.ended == 1; }));
  EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

// An HTTP/2 frame.
std::string frame(unsigned char kind, unsigned char flags, int stream, const std::string& payload) {
  const auto size = static_cast<std::uint32_t>(payload.size());
  std::string bytes;
  for (const int shift : {16, 8, 0}) bytes += static_cast<char>(size >> shift & 0xffu);
  bytes += static_cast<char>(kind);
  bytes += static_cast<char>(flags);
  for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(stream >> shift & 0xff);
  return bytes + payload;
}

TEST(ServiceLimits, AConnectionWhoseHeadersNeverEndIsDropped) {
  const auto host = ServiceHost::start({.limits = {.message_bytes = 1 << 20}}, {}).value();
  const Descriptor connection = connected_to(*host);
  constexpr unsigned char kHeaders = 1, kSettings = 4, kContinuation = 9;
  const std::string header = std::string("\x00\x01x\x7f\x81\x7c", 6) + std::string(16000, 'y');  // x: yyy...
  const std::string begin =
      "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(kSettings, 0, 0, "") + frame(kHeaders, 0, 1, header);
  ASSERT_GT(::send(connection.get(), begin.data(), begin.size(), MSG_NOSIGNAL), 0);
  const std::string more = frame(kContinuation, 0, 1, header);
  constexpr std::int64_t kMost = std::int64_t{4} << 30;
  std::int64_t sent = 0;
  for (ssize_t count = 1; count > 0 && sent < kMost; sent += count)
    count = ::send(connection.get(), more.data(), more.size(), MSG_NOSIGNAL);
  EXPECT_LT(sent, kMost) << "the server took everything";
  const auto stub = v1::ClockService::NewStub(dial(host->address()));
  grpc::ClientContext context;
  set_deadline(context, seconds(20));
  v1::ExchangeResponse response;
  EXPECT_OK(stub->Exchange(&context, {}, &response));
}

TEST(ServiceLimits, AConnectionThatSendsMuchInMessagesIsKept) {
  Streams streams;
  const auto host = ServiceHost::start({.limits = {.message_bytes = 1 << 20}}, {&streams}).value();
  const auto stub = v1::SessionService::NewStub(dial(host->address()));
  grpc::ClientContext context;
  set_deadline(context, seconds(60));
  v1::UploadImageResponse response;
  const auto writer = stub->UploadImage(&context, &response);
  v1::UploadImageRequest request;
  request.set_chunk(std::string((1 << 20) - 100, 'p'));
  const auto begun = std::chrono::steady_clock::now();
  // For longer than the watch waits between two looks.
  while (std::chrono::steady_clock::now() - begun < seconds(1)) ASSERT_TRUE(writer->Write(request));
  writer->WritesDone();
  EXPECT_OK(writer->Finish());
}

TEST(ServiceLimits, ConnectionsThatSayNothingAreClosed) {
  const auto host =
      ServiceHost::start({.limits = {.handshake = milliseconds(200), .idle = milliseconds(200)}}, {}).value();
  EXPECT_TRUE(is_closed(connected_to(*host)));
  const auto channel = dial(host->address());
  ASSERT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() + seconds(10)));
  EXPECT_TRUE(
      channel->WaitForStateChange(GRPC_CHANNEL_READY, std::chrono::system_clock::now() + seconds(20)));
}

TEST(ServiceLimits, ConnectionsBeyondTheMostAreClosedAndOthersServed) {
  const int most = highest_descriptor() + 40;  // some lower numbers may be free
  const auto host =
      ServiceHost::start({.limits = {.descriptors = most, .handshake = seconds(60)}}, {}).value();
  const auto channel = dial(host->address());
  ASSERT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() + seconds(10)));
  std::vector<Descriptor> idle;
  for (int i = 0; i < most; ++i) idle.push_back(connected_to(*host));
  EXPECT_TRUE(is_closed(idle.back()));
  grpc::ClientContext context;
  set_deadline(context, seconds(10));
  v1::ExchangeResponse response;
  EXPECT_OK(v1::ClockService::NewStub(channel)->Exchange(&context, {}, &response));
  idle.clear();
  EXPECT_TRUE(until([&] { return answers(*host); }));
}

TEST(ServiceLimits, RunningOutOfDescriptorsDeafensNobody) {
  const auto host = ServiceHost::start({.limits = {.handshake = milliseconds(200)}}, {}).value();
  ASSERT_TRUE(answers(*host));
  std::vector<Descriptor> connections;
  for (int i = 0; i < 16; ++i) connections.push_back(unconnected());
  std::vector<Descriptor> taken;  // all below the limit
  rlimit usual{};
  ::getrlimit(RLIMIT_NOFILE, &usual);
  rlimit few = usual;
  few.rlim_cur = static_cast<rlim_t>(highest_descriptor()) + 1;
  ::setrlimit(RLIMIT_NOFILE, &few);
  for (int fd = 0; (fd = ::dup(0)) >= 0;) taken.emplace_back(fd);
  EXPECT_EQ(errno, EMFILE);
  for (const Descriptor& connection : connections) connect_to(*host, connection);
  for (const Descriptor& connection : connections) EXPECT_TRUE(is_closed(connection));
  taken.clear();
  ::setrlimit(RLIMIT_NOFILE, &usual);
  EXPECT_TRUE(answers(*host));
}

TEST(ServiceLimits, ADaemonSeesWhetherItAnswers) {
  Streams streams;
  const auto host = ServiceHost::start({}, {&streams}).value();
  EXPECT_TRUE(host->answers(seconds(10)));
}

TEST(ServiceLimits, TooManyCallsAtOnceAreRefusedAndTheRestGoesOn) {
  Streams streams;
  const auto host = ServiceHost::start({.limits = {.calls = 12}}, {&streams}).value();
  const auto stub = v1::SessionService::NewStub(dial(host->address()));
  struct Upload {
    grpc::ClientContext context;
    v1::UploadImageResponse response;
    std::unique_ptr<grpc::ClientWriter<v1::UploadImageRequest>> writer;
  };
  std::vector<std::unique_ptr<Upload>> uploads;
  int refused = 0;
  for (int i = 0; i < 40; ++i) {
    auto upload = std::make_unique<Upload>();
    set_deadline(upload->context, seconds(20));
    upload->writer = stub->UploadImage(&upload->context, &upload->response);
    uploads.push_back(std::move(upload));
  }
  v1::UploadImageRequest request;
  request.set_chunk("a beginning");
  ASSERT_TRUE(until([&] {  // one has no thread, and all others keep writing
    return std::any_of(uploads.begin(), uploads.end(),
                       [&](const auto& upload) { return !upload->writer->Write(request); });
  }));
  for (const auto& upload : uploads) {
    upload->writer->WritesDone();
    refused += upload->writer->Finish().error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(streams.ended, 0);
  EXPECT_EQ(refused + streams.ended, 40);
  EXPECT_TRUE(answers(*host));
}

}  // namespace
}  // namespace glasswing
