#include "core/telemetry/metrics.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <optional>
#include <thread>

#include "core/service/service.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

// The current value of a metric; empty: there is none.
std::optional<prometheus::ClientMetric> told(const std::string& name, const prometheus::Labels& labels) {
  for (const prometheus::MetricFamily& family : collect_metrics()) {
    if (family.name != name) continue;
    for (const prometheus::ClientMetric& metric : family.metric) {
      prometheus::Labels its;
      for (const auto& label : metric.label) its[label.name] = label.value;
      if (its == labels) return metric;
    }
  }
  return std::nullopt;
}

double count_of(const std::string& method, const std::string& code) {
  const auto metric = told("glasswing_rpcs_total", {{"method", method}, {"code", code}});
  return metric ? metric->counter.value : 0.0;
}

// A whole HTTP answer.
std::string get(const std::string& address, const std::string& path) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(std::atoi(address.substr(address.rfind(':') + 1).c_str())));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string answer;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) == 0) {
    const std::string request = "GET " + path + " HTTP/1.0\r\n\r\n";
    EXPECT_EQ(::write(socket, request.data(), request.size()), static_cast<ssize_t>(request.size()));
    char part[4096];
    for (ssize_t read; (read = ::read(socket, part, sizeof(part))) > 0;) answer.append(part, read);
  }
  ::close(socket);
  return answer;
}

TEST(Metrics, AreOneForANameAndItsLabels) {
  prometheus::Counter& here = counter("glasswing_test_total", "Of this test.", {{"kind", "a"}});
  EXPECT_EQ(&here, &counter("glasswing_test_total", "Of this test.", {{"kind", "a"}}));
  EXPECT_NE(&here, &counter("glasswing_test_total", "Of this test.", {{"kind", "b"}}));
  here.Increment(2.0);
  EXPECT_EQ(told("glasswing_test_total", {{"kind", "a"}})->counter.value, 2.0);
  EXPECT_EQ(told("glasswing_test_total", {{"kind", "b"}})->counter.value, 0.0);
}

TEST(Metrics, AreCountedFromManyThreads) {
  constexpr int kThreads = 4, kEach = 1000;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([] {
        for (int n = 0; n < kEach; ++n) {
          counter("glasswing_test_threads_total", "Of this test.").Increment();
          histogram("glasswing_test_threads_seconds", "Of this test.", {1.0}).Observe(0.5);
        }
      });
    }
  }
  EXPECT_EQ(told("glasswing_test_threads_total", {})->counter.value, kThreads * kEach);
  const auto seconds = told("glasswing_test_threads_seconds", {});
  EXPECT_EQ(seconds->histogram.sample_count, kThreads * kEach);
  EXPECT_EQ(seconds->histogram.sample_sum, 0.5 * kThreads * kEach);
}

TEST(Metrics, ThatAreAskedForEndWithTheirOwner) {
  double value = 1.0;
  {
    const AskedMetrics asked([&] {
      return std::vector{gauges("glasswing_test_asked", "Of this test.", {{{}, value}})};
    });
    EXPECT_EQ(told("glasswing_test_asked", {})->gauge.value, 1.0);
    value = 2.0;
    EXPECT_EQ(told("glasswing_test_asked", {})->gauge.value, 2.0);
  }
  EXPECT_FALSE(told("glasswing_test_asked", {}));
}

TEST(MetricsHost, AnswersWithEverythingOfTheProcess) {
  const auto host =
      MetricsHost::start({.address = "127.0.0.1:0", .program = "glasswing-test", .build = "1a2b3c4d"})
          .value();
  gauge("glasswing_test_seen", "Of this test.").Set(42.0);
  const std::string answer = get(host->address(), "/metrics");
  EXPECT_THAT(answer, HasSubstr("200 OK"));
  EXPECT_THAT(answer, HasSubstr("\nglasswing_test_seen 42\n"));
  EXPECT_THAT(answer, HasSubstr("program=\"glasswing-test\""));
  EXPECT_THAT(answer, HasSubstr("build=\"1a2b3c4d\""));
  for (const char* name : {"process_cpu_seconds_total", "process_resident_memory_bytes", "process_open_fds",
                           "glasswing_heap_used_bytes", "process_max_fds", "process_start_time_seconds"}) {
    EXPECT_THAT(answer, HasSubstr(std::string("\n") + name + " ")) << name;
  }
  EXPECT_THAT(get(host->address(), "/other"), HasSubstr("404"));
}

TEST(MetricsHost, TellsTheTruthOfItsProcess) {
  const auto of = [](const std::string& text, const std::string& name) {
    const size_t at = text.find("\n" + name + " ");
    return at == std::string::npos ? -1.0 : std::strtod(text.c_str() + at + name.size() + 2, nullptr);
  };
  const auto host =
      MetricsHost::start({.address = "127.0.0.1:0", .program = "glasswing-test", .build = ""}).value();
  const std::string before = get(host->address(), "/metrics");
  // This process started before now and after the machine; CPU time never decreases.
  const double now = static_cast<double>(::time(nullptr));
  EXPECT_LE(of(before, "process_start_time_seconds"), now + 1.0);
  EXPECT_GT(of(before, "process_start_time_seconds"), now - 3600.0);
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  const std::vector<char> memory(64u << 20, 'x');
  const std::string after = get(host->address(), "/metrics");
  EXPECT_GE(of(after, "process_cpu_seconds_total"), of(before, "process_cpu_seconds_total"));
  EXPECT_EQ(of(after, "process_open_fds"), of(before, "process_open_fds") + 2);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // these have allocators of their own
  // The allocator may have returned a little to the system meanwhile.
  EXPECT_GT(of(after, "glasswing_heap_used_bytes"), of(before, "glasswing_heap_used_bytes") + (32u << 20));
#endif
  EXPECT_GT(of(after, "process_resident_memory_bytes"),
            of(before, "process_resident_memory_bytes") + (32u << 20));
  EXPECT_EQ(memory.back(), 'x');
  ::close(pipe_ends[0]);
  ::close(pipe_ends[1]);
}

TEST(MetricsHost, ListensOnLoopbackOnlyAndOnAPortOfItsOwn) {
  const auto start = [](const std::string& address) {
    return MetricsHost::start({.address = address, .program = "", .build = ""});
  };
  EXPECT_EQ(start("").value(), nullptr);
  for (const char* address : {"0.0.0.0:0", "192.0.2.1:9440", "9440", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x",
                              "127.0.0.1:70000", "127.0.0.1:9440,0.0.0.0:9441"}) {
    const absl::Status status = start(address).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << address << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(address));
  }
  const auto host = start("127.0.0.1:0").value();
  const absl::Status taken = start(host->address()).status();
  EXPECT_TRUE(absl::IsUnavailable(taken)) << taken;
}

TEST(RpcMetrics, CountCallsByMethodAndCode) {
  const auto host = ServiceHost::start({}, {}).value();
  const auto stub = v1::ClockService::NewStub(dial(host->address()));
  const std::string method = "ClockService/Exchange";
  const double before = count_of(method, "OK");
  for (int i = 0; i < 3; ++i) {
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(5));
    v1::ExchangeResponse response;
    ASSERT_OK(stub->Exchange(&context, {}, &response));
  }
  host->stop(std::chrono::milliseconds(0));  // no call is left running
  EXPECT_EQ(count_of(method, "OK"), before + 3);
  EXPECT_EQ(told("glasswing_rpc_seconds", {{"method", method}})->histogram.sample_count, before + 3);
  EXPECT_EQ(told("glasswing_rpcs_running", {{"method", method}})->gauge.value, 0.0);
}

}  // namespace
}  // namespace glasswing
