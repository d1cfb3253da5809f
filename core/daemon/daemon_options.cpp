#include "core/daemon/daemon_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace glasswing {

void add_tls_options(CLI::App& app, TlsFiles& files) {
  const auto add = [&](const char* name, std::string& file, const char* variable,
                       const std::string& description) {
    app.add_option(name, file, description + "; or $" + variable)->envname(variable)->type_name("FILE");
  };
  add("--ca", files.ca, "GLASSWING_CA",
      "PEM of the CA that signed the certificates of all programs; turns TLS on for calls");
  add("--certificate", files.certificate, "GLASSWING_CERTIFICATE",
      "PEM of this program's own certificate; callers must then use TLS and show one of the same CA");
  add("--key", files.key, "GLASSWING_KEY", "PEM of the certificate's key");
}

void add_listen_options(CLI::App& app, ListenOptions& listen, const std::string& listens) {
  app.add_option("--listen", listen.address,
                 "host:port " + listens + "; beyond this machine only with --certificate")
      ->capture_default_str();
  app.add_option("--advertise", listen.advertised,
                 "host:port at which others call it; --listen if left out, which must then name one address")
      ->type_name("HOST:PORT");
  app.add_flag("--reflection", listen.reflection, "let gRPC tools list the services");
}

void BackendOptions::add(CLI::App& app, std::string_view backend, const std::function<void(CLI::App&)>& add) {
  const size_t before = app.get_options().size();
  add(app);
  const std::vector<CLI::Option*> options = app.get_options();
  for (size_t i = before; i < options.size(); ++i) share(backend, options[i]->get_name());
}

void BackendOptions::share(std::string_view backend, std::string_view option) {
  takers_[std::string(option)].emplace_back(backend);
}

absl::Status BackendOptions::check(const CLI::App& app, std::string_view backend) const {
  for (const auto& [option, takers] : takers_) {
    if (app.count(option) == 0 || std::ranges::find(takers, backend) != takers.end()) continue;
    return absl::InvalidArgumentError(
        fmt::format("{} is given with --backend {}; it must be left out, or used with --backend {}", option,
                    backend, fmt::join(takers, " or ")));
  }
  return absl::OkStatus();
}

}  // namespace glasswing
