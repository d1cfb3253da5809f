#include "console/routes/event_stream.h"

#include <fmt/format.h>

#include <utility>

#include "console/http/http_host.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kCheckInterval(1), kKeepAliveInterval(5);
constexpr std::chrono::milliseconds kPollInterval(250);

bool send_end(httplib::DataSink& sink, const absl::Status& status) {
  const std::string event = fmt::format("event: end\ndata: {}\n\n", json_of(status));
  sink.write(event.data(), event.size());
  sink.done();
  return true;
}

}  // namespace

EventStream::EventStream(std::unique_ptr<JsonCall> call, std::string first, std::string peer,
                         std::function<absl::Status()> check_login)
    : call_(std::move(call)),
      first_(std::move(first)),
      peer_(std::move(peer)),
      check_login_(std::move(check_login)) {}

bool EventStream::send_next(httplib::DataSink& sink) {
  if (Clock::now() - checked_ >= kCheckInterval) {
    checked_ = Clock::now();
    if (const absl::Status valid = check_login_(); !valid.ok()) return send_end(sink, valid);
  }
  std::string message = std::exchange(first_, "");
  const JsonCall::Got got = message.empty() ? call_->next(kPollInterval, message) : JsonCall::Got::kMessage;
  if (got == JsonCall::Got::kEnd) return send_end(sink, call_->outcome(peer_));
  if (got == JsonCall::Got::kNothingYet) {
    if (!sink.is_writable()) return false;
    if (Clock::now() - sent_ < kKeepAliveInterval) return true;
  }
  sent_ = Clock::now();
  const std::string event =
      got == JsonCall::Got::kMessage ? fmt::format("data: {}\n\n", message) : ": alive\n\n";
  return sink.write(event.data(), event.size());
}

}  // namespace glasswing
