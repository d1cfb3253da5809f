// Options that several daemons have.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/security/tls.h"
#include "core/service/service.h"

namespace glasswing {

// --ca, --certificate and --key, or the environment variables that the client reads too: for use_tls().
void add_tls_options(CLI::App& app, TlsFiles& files);

// --listen, --advertise and --reflection. `listens` completes "host:port ".
void add_listen_options(CLI::App& app, ListenOptions& listen, const std::string& listens = "to listen on");

// Which options each device behind --backend takes.
class BackendOptions {
 public:
  // `backend` takes the options that `add` declares.
  void add(CLI::App& app, std::string_view backend, const std::function<void(CLI::App&)>& add);
  // `backend` takes an option that others may take too.
  void share(std::string_view backend, std::string_view option);
  // INVALID_ARGUMENT: an option was given that `backend` does not take and others do.
  absl::Status check(const CLI::App& app, std::string_view backend) const;

 private:
  std::map<std::string, std::vector<std::string>> takers_;  // by option
};

}  // namespace glasswing
