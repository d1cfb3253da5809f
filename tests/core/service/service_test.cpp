#include "core/service/service.h"

#include <arpa/inet.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <string>
#include <thread>

#include "core/base/time.h"
#include "core/file/descriptor.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST(ServiceHost, TellsItsClockAndEndsInOrder) {
  const auto host = ServiceHost::start({}, {}).value();
  const auto stub = v1::ClockService::NewStub(dial(host->address()));
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(5));
  v1::ExchangeResponse response;
  const nanoseconds sent = monotonic_now();
  ASSERT_OK(stub->Exchange(&context, {}, &response));
  EXPECT_LE(sent.count(), response.received_ns());
  EXPECT_LE(response.received_ns(), response.sent_ns());
  EXPECT_LE(response.sent_ns(), monotonic_now().count());
  host->stop(std::chrono::milliseconds(0));
}

TEST(ServiceHost, ListensOnLoopbackOnlyAndOnAPortOfItsOwn) {
  for (const char* address : {"0.0.0.0:0", "192.0.2.1:7440", "[::]:0", "example.org:1"}) {
    const absl::Status status = ServiceHost::start({.address = address, .reflection = false}, {}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << address << ": " << status;
  }
  const auto host = ServiceHost::start({}, {}).value();
  const absl::Status taken =
      ServiceHost::start({.address = host->address(), .reflection = false}, {}).status();
  EXPECT_TRUE(absl::IsUnavailable(taken)) << taken;
}

grpc::StatusCode reflection_code(const ServiceHost& host) {
  grpc::GenericStub stub(dial(host.address()));
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(20));
  grpc::CompletionQueue queue;
  const grpc::Slice empty;
  const auto call =
      stub.PrepareUnaryCall(&context, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
                            grpc::ByteBuffer(&empty, 1), &queue);
  call->StartCall();
  grpc::ByteBuffer answer;
  grpc::Status status;
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  return status.error_code();
}

TEST(ServiceHost, ReflectsOnlyIfAskedTo) {
  EXPECT_EQ(reflection_code(*ServiceHost::start({}, {}).value()), grpc::StatusCode::UNIMPLEMENTED);
  const auto reflecting = ServiceHost::start({.reflection = true}, {}).value();
  EXPECT_EQ(reflection_code(*reflecting), grpc::StatusCode::OK);
  // One server of a process with it does not give it to the next.
  EXPECT_EQ(reflection_code(*ServiceHost::start({}, {}).value()), grpc::StatusCode::UNIMPLEMENTED);
}

TEST(Dial, ACallToAMachineThatVanishedEnds) {
  const Descriptor listener(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{
      .sin_family = AF_INET, .sin_port = 0, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(listener.get(), reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(listener.get(), 1), 0);
  ASSERT_EQ(::getsockname(listener.get(), reinterpret_cast<sockaddr*>(&address), &size), 0);
  Descriptor connection;
  // HTTP/2's first frame, of settings, and nothing after it.
  const std::jthread peer([&] {
    constexpr std::array<char, 9> kSettings{0, 0, 0, 4};
    connection = Descriptor(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
    ::send(connection.get(), kSettings.data(), kSettings.size(), MSG_NOSIGNAL);
  });
  const auto stub = v1::ClockService::NewStub(dial("127.0.0.1:" + std::to_string(ntohs(address.sin_port))));
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(90));
  v1::ExchangeResponse response;
  const grpc::Status status = stub->Exchange(&context, {}, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE) << status.error_message();
  EXPECT_NE(status.error_message().find("keepalive"), std::string::npos) << status.error_message();
}

TEST(Status, CodesCrossTheWireUnchanged) {
  for (int code = 1; code <= 16; ++code) {
    const absl::Status status(static_cast<absl::StatusCode>(code), "why");
    EXPECT_EQ(from_grpc(to_grpc(status)), status);
  }
  EXPECT_OK(from_grpc(grpc::Status::OK));
}

}  // namespace
}  // namespace glasswing
