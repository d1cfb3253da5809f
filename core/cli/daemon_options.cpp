#include "core/cli/daemon_options.h"

namespace glasswing {

void add_tls_options(CLI::App& app, TlsFiles& files) {
  const auto add = [&](const char* name, std::string& file, const char* variable,
                       const std::string& description) {
    app.add_option(name, file, description + "; or $" + variable)->envname(variable)->type_name("FILE");
  };
  add("--ca", files.ca, "GLASSWING_CA",
      "PEM of the CA that signed the certificates of all programs; calls use TLS then");
  add("--certificate", files.certificate, "GLASSWING_CERTIFICATE",
      "PEM of this program's own certificate; callers must then use TLS and have one of that CA");
  add("--key", files.key, "GLASSWING_KEY", "PEM of the key to it");
}

void add_listen_options(CLI::App& app, ListenOptions& listen, const std::string& listens) {
  app.add_option("--listen", listen.address,
                 "host:port " + listens + "; beyond this machine only with --certificate")
      ->capture_default_str();
  app.add_option("--advertise", listen.advertised,
                 "host:port by which others call it; --listen if left out, which must name one address then")
      ->type_name("HOST:PORT");
  app.add_flag("--reflection", listen.reflection, "let gRPC tools list the services");
}

}  // namespace glasswing
