#include "core/daemon/daemon_options.h"

#include <fmt/format.h>

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

absl::Status check_simulated_options(const CLI::App& app, const std::string& backend) {
  if (backend == "sim") return absl::OkStatus();
  for (const CLI::Option* option : app.get_options()) {
    const std::string name = option->get_name();
    const bool is_simulated =
        name.starts_with("--fault-") || name.starts_with("--true-") || name.starts_with("--clock-");
    if (is_simulated && option->count() > 0) {
      return absl::InvalidArgumentError(fmt::format(
          "{} is given with --backend {}; it must be left out, or used with --backend sim", name, backend));
    }
  }
  return absl::OkStatus();
}

}  // namespace glasswing
