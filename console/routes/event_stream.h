// A streaming call, answered by server-sent events; the last one is "end" with the call's status.
#pragma once

#include <absl/status/status.h>
#include <httplib.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "console/routes/json_call.h"

namespace glasswing {

class EventStream {
 public:
  // `first`: the call's first message in JSON; empty: none has come yet. `peer` names the called program.
  // `check_login` is called every second, and ends the stream by an error.
  EventStream(std::unique_ptr<JsonCall> call, std::string first, std::string peer,
              std::function<absl::Status()> check_login);

  // Sends the next event if it comes soon. False: the browser has left.
  bool send_next(httplib::DataSink& sink);

 private:
  using Clock = std::chrono::steady_clock;

  const std::unique_ptr<JsonCall> call_;
  std::string first_;
  const std::string peer_;
  const std::function<absl::Status()> check_login_;
  Clock::time_point checked_ = Clock::now(), sent_ = checked_;
};

}  // namespace glasswing
