#include "console/routes/console.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>
#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "console/routes/cookies.h"
#include "console/routes/event_stream.h"
#include "core/base/status.h"
#include "core/process/pause.h"
#include "core/security/roles.h"
#include "core/service/service.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {
namespace {

namespace pb = google::protobuf;
using httplib::Request;
using httplib::Response;

constexpr std::chrono::hours kMaxStream(24);
// The server ends a fit after ten minutes (rig_service.proto).
constexpr std::chrono::minutes kFitTimeout(11);
constexpr std::chrono::milliseconds kFirstMessage(250);
constexpr std::chrono::seconds kAnnounceInterval(1);
constexpr size_t kMaxJson = size_t{4} << 20, kMaxImage = size_t{64} << 20, kMaxToken = 4096;
constexpr const char* kJson = "application/json";
constexpr const char* kHoldHeader = "X-Glasswing-Hold";

std::string principal_json(const Principal& principal) {
  nlohmann::json json{{"name", principal.name},
                      {"role", (principal.roles & only(Role::kOperator)) != 0 ? "operator" : "viewer"}};
  json["expires"] = principal.expires.time_since_epoch().count();
  return json.dump();
}

// Keeps the first error, with line and column from 1.
class FirstError final : public pb::io::ErrorCollector {
 public:
  void AddError(int line, pb::io::ColumnNumber column, const std::string& message) override {
    if (text.empty()) text = fmt::format("line {}, column {}: {}", line + 1, column + 1, message);
  }
  std::string text;
};

void parse_plan(const std::string& text, Response& response) {
  v1::Plan plan;
  FirstError error;
  pb::TextFormat::Parser parser;
  parser.RecordErrorsTo(&error);
  std::string json;
  if (!parser.ParseFromString(text, &plan))
    return refuse(response, absl::InvalidArgumentError("the plan's " + error.text));
  if (!pb::util::MessageToJsonString(plan, &json).ok())
    return refuse(response, absl::InvalidArgumentError("the plan's text is not UTF-8"));
  response.set_content(json, kJson);
}

// Reads the whole body. INVALID_ARGUMENT: it has more than `max_bytes`.
absl::StatusOr<std::string> body_of(const httplib::ContentReader& content, size_t max_bytes) {
  std::string body;
  bool fits = true;
  const bool whole = content([&](const char* bytes, size_t size) {
    fits = fits && body.size() + size <= max_bytes;
    if (fits) body.append(bytes, size);
    return true;
  });
  if (!whole) return absl::InvalidArgumentError("the request's body is incomplete");
  if (!fits)
    return absl::InvalidArgumentError(fmt::format("the request's body has more than {} bytes", max_bytes));
  return body;
}

// An error of the link to the server. A page shows that the server is away, and asks again.
void refuse_visit(Response& response, const absl::Status& status) {
  if (absl::IsUnavailable(status)) response.set_header("Retry-After", "1");
  refuse(response, status);
}

absl::Status anybody(const Request&, const Principal&) {
  return absl::OkStatus();
}

// What the server would refuse; it logs what it admits.
absl::Status check_server_call(std::string_view method, const Principal& principal) {
  for (const MethodAccess& access : access_table()) {
    if (access.method == method && (access.roles & principal.roles) == 0)
      return admit(method, principal.roles, principal.title());
  }
  return absl::OkStatus();
}

// Of the path's last two parts.
absl::StatusOr<JsonMethod> method_in(const Request& request) {
  const size_t last = request.matches.size() - 1;
  return JsonMethod::find(request.matches[last - 1], request.matches[last]);
}

// Nodes know no logins: what the console may do there, it may do for viewers and operators alike.
absl::Status check_node_call(const std::string& method, const Principal& principal) {
  GW_RETURN_IF_ERROR(admit(method, principal.roles, principal.title()));
  return admit(method, only(Role::kConsole), "console");
}

std::chrono::milliseconds timeout_of(const JsonMethod& method) {
  return method.name() == "RigService/FitCalibration" ? kFitTimeout : std::chrono::milliseconds(kCallTimeout);
}

// The token of the browser's hold of the rig; empty: none. INVALID_ARGUMENT: it could not be a token.
absl::StatusOr<std::string> hold_in(const Request& request) {
  constexpr size_t kMaxBytes = 128;
  std::string token = request.get_header_value(kHoldHeader);
  if (token.size() <= kMaxBytes && std::ranges::all_of(token, absl::ascii_isalnum)) return token;
  return absl::InvalidArgumentError(fmt::format("the header {} is not a hold's token", kHoldHeader));
}

// Confines the page to its own scripts, styles and connections.
httplib::Headers security_headers(bool has_tls) {
  httplib::Headers headers = {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
       "connect-src 'self'; worker-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
       "frame-ancestors 'none'"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Cross-Origin-Opener-Policy", "same-origin"}};
  if (has_tls) headers.emplace("Strict-Transport-Security", "max-age=31536000");
  return headers;
}

// Bytes of a posted body; absent: nothing is posted there.
std::optional<size_t> max_body_of(const std::string& path) {
  if (path == "/login" || path == "/logout") return kMaxToken;
  if (path == "/images") return kMaxImage;
  if (path.starts_with("/imports/"))
    return path.ends_with("/frames") ? ImportRoutes::kMaxFrames : ImportRoutes::kMaxManifest;
  if (path == "/geometries" || path == "/rays" || path == "/rays.exr") return RayRoutes::kMaxGeometry;
  if (path == "/plans" || path.starts_with("/api/")) return kMaxJson;
  return std::nullopt;
}

}  // namespace

std::filesystem::path default_console_files() {
  std::error_code error;
  const std::filesystem::path root =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path().parent_path();
  const std::filesystem::path installed = root / "share/glasswing/console";
  return std::filesystem::exists(installed) ? installed : root / "page";
}

absl::StatusOr<std::unique_ptr<Console>> Console::start(const ConsoleOptions& options,
                                                        const ServerLink& server) {
  GW_RETURN_IF_ERROR(check_advertised({.address = options.address, .advertised = options.advertised}));
  std::unique_ptr<Console> self(new Console(server));
  GW_ASSIGN_OR_RETURN(self->host_, HttpHost::bind(options.address));
  self->url_ = fmt::format("{}://{}", self->host_->has_tls() ? "https" : "http",
                           options.advertised.empty() ? self->host_->address() : options.advertised);
  self->add_routes(options.files);
  self->host_->serve();
  spdlog::info("listening on url={}", self->url_);
  self->announcing_ = std::jthread([console = self.get()](std::stop_token stop) { console->announce(stop); });
  return self;
}

void Console::announce(const std::stop_token& stop) const {
  bool is_known = true;  // so that the first failure is logged
  do {
    const absl::Status status = server_.announce(url_);
    if (status.ok() != is_known) {
      is_known = status.ok();
      if (is_known) spdlog::info("the server knows this console url={}", url_);
      if (!is_known)
        spdlog::warn("the server does not accept this console yet, retrying: {}",
                     std::string(status.message()));
    }
  } while (pause(stop, kAnnounceInterval));
}

Console::~Console() {
  stopping_ = true;
  if (host_ != nullptr) host_->stop();
}

void Console::add_routes(const std::filesystem::path& files) {
  host_->limit_bodies(max_body_of);
  httplib::Server& routes = host_->routes();
  routes.set_default_headers(security_headers(host_->has_tls()));
  routes.Post("/login",
              [this](const Request& request, Response& response, const httplib::ContentReader& content) {
                const absl::StatusOr<std::string> body = body_of(content, kMaxToken);
                if (!body.ok()) return refuse(response, body.status());
                log_in(request, *body, response);
              });
  routes.Post("/logout",
              guarded(kMaxToken, anybody,
                      [this](const Login& login, const Request&, const std::string&, Response& response) {
                        if (const absl::Status status = server_.log_out(login); !status.ok())
                          return refuse_visit(response, status);
                        response.set_header("Set-Cookie",
                                            cookie_of("", std::chrono::seconds(0), host_->has_tls()));
                        response.set_content("{}", kJson);
                      }));
  routes.Get("/me", guarded([](const Login& login, const Request&, Response& response) {
               response.set_content(principal_json(login.principal), kJson);
             }));
  const auto may_call_node = [](const Request& request, const Principal& principal) -> absl::Status {
    GW_ASSIGN_OR_RETURN(const JsonMethod method, method_in(request));
    return check_node_call(method.name(), principal);
  };
  routes.Post(R"(/api/nodes/([A-Za-z0-9._-]+)/(\w+)/(\w+))",
              guarded(kMaxJson, may_call_node,
                      [this](const Login& login, const Request& request, const std::string& body,
                             Response& response) {
                        call(request.matches[1].str(), login, request, body, response);
                      }));
  const auto may_call = [](const Request& request, const Principal& principal) -> absl::Status {
    GW_ASSIGN_OR_RETURN(const JsonMethod method, method_in(request));
    return check_server_call(method.name(), principal);
  };
  routes.Post(R"(/api/(\w+)/(\w+))",
              guarded(kMaxJson, may_call,
                      [this](const Login& login, const Request& request, const std::string& body,
                             Response& response) { call(std::nullopt, login, request, body, response); }));
  add_data_routes();
  routes.set_mount_point(
      "/assets", (files / "assets").string(),
      {{"Cache-Control", "public, max-age=31536000, immutable"}});  // names include checksums
  routes.set_mount_point("/", files.string(), {{"Cache-Control", "no-cache"}});
  // Reached only while the folder has no page.
  routes.Get("/", [files](const Request&, Response& response) {
    response.status = 404;
    response.set_content(
        fmt::format(
            "The console's page was not found: {} {}. Build it with Node.js (deploy/build), or name its "
            "folder with --files and start the console again.\n",
            files.string(), std::filesystem::is_directory(files) ? "has no index.html" : "is not a folder"),
        "text/plain");
  });
  routes.set_exception_handler([](const Request& request, Response& response, std::exception_ptr) {
    spdlog::error("console failed path={}", request.path);
    refuse(response, absl::InternalError("the console could not answer"));
  });
}

void Console::add_data_routes() {
  httplib::Server& routes = host_->routes();
  routes.Post("/plans", guarded(kMaxJson, anybody,
                                [](const Login&, const Request&, const std::string& body,
                                   Response& response) { parse_plan(body, response); }));
  const auto of = [](const char* method) -> Check {
    return
        [method](const Request&, const Principal& principal) { return check_server_call(method, principal); };
  };
  routes.Post("/images",
              guarded(kMaxImage, of("SessionService/UploadImage"),
                      [this](const Login& login, const Request&, const std::string& body,
                             Response& response) { sessions_.store_image(login, body, response); }));
  routes.Post(R"(/imports/([A-Za-z0-9._-]+))",
              guarded(ImportRoutes::kMaxManifest, of("SessionService/BeginImport"),
                      [this](const Login& login, const Request& request, const std::string& body,
                             Response& response) { imports_.begin(login, request, body, response); }));
  // Its body is not held. Of a refused request it is not read, and the connection ends.
  routes.Post(R"(/imports/([A-Za-z0-9._-]+)/frames)",
              [this](const Request& request, Response& response, const httplib::ContentReader& content) {
                response.set_header("Cache-Control", "no-store");
                const absl::StatusOr<Login> login = authenticate(request);
                if (!login.ok()) return refuse_visit(response, login.status());
                imports_.put_frames(*login, request, content, response);
              });
  using Make = void (RayRoutes::*)(const Login&, const Request&, const std::string&, Response&) const;
  const auto make = [&](const char* path, Make own) {
    routes.Post(path,
                guarded(RayRoutes::kMaxGeometry, anybody,
                        [this, own](const Login& login, const Request& request, const std::string& body,
                                    Response& response) { (rays_.*own)(login, request, body, response); }));
  };
  make("/geometries", &RayRoutes::read_geometry);
  make("/rays", &RayRoutes::make);
  make("/rays.exr", &RayRoutes::make_file);
  using Send = void (SessionRoutes::*)(const Login&, const Request&, Response&) const;
  const auto send = [&](const char* path, Send own) {
    routes.Get(path, guarded([this, own](const Login& login, const Request& request, Response& response) {
                 (sessions_.*own)(login, request, response);
               }));
  };
  send(R"(/mattes/([A-Za-z0-9._-]+)\.exr)", &SessionRoutes::send_matte);
  send(R"(/stmaps/([A-Za-z0-9._-]+)\.exr)", &SessionRoutes::send_stmap);
  send(R"(/archives/([A-Za-z0-9._-]+)\.tar)", &SessionRoutes::send_archive);
  send(R"(/frames/([A-Za-z0-9._-]+)/(\w+)\.(tif|jpg))", &SessionRoutes::send_frame);
  send(R"(/pixels/([A-Za-z0-9._-]+))", &SessionRoutes::send_samples);
}

absl::StatusOr<Login> Console::authenticate(const Request& request) const {
  GW_RETURN_IF_ERROR(check_origin(request, host_->has_tls()));
  Login login{.secret = login_in(request), .principal = {}};
  GW_ASSIGN_OR_RETURN(login.principal, server_.principal_of(login.secret));
  return login;
}

httplib::Server::Handler Console::guarded(Handler handler) const {
  return [this, handler = std::move(handler)](const Request& request, Response& response) {
    response.set_header("Cache-Control", "no-store");
    const absl::StatusOr<Login> login = authenticate(request);
    if (!login.ok()) return refuse_visit(response, login.status());
    handler(*login, request, response);
  };
}

httplib::Server::HandlerWithContentReader Console::guarded(size_t max_bytes, Check may,
                                                           BodyHandler handler) const {
  return [this, max_bytes, may = std::move(may), handler = std::move(handler)](
             const Request& request, Response& response, const httplib::ContentReader& content) {
    response.set_header("Cache-Control", "no-store");
    const absl::StatusOr<Login> login = authenticate(request);
    const absl::Status admitted = login.ok() ? may(request, login->principal) : login.status();
    const absl::StatusOr<std::string> body = body_of(content, admitted.ok() ? max_bytes : 0);
    if (!login.ok()) return refuse_visit(response, login.status());
    if (!admitted.ok()) return refuse(response, admitted);
    if (!body.ok()) return refuse(response, body.status());
    handler(*login, request, *body, response);
  };
}

void Console::log_in(const Request& request, const std::string& text, Response& response) {
  if (const absl::Status status = check_origin(request, host_->has_tls()); !status.ok())
    return refuse(response, status);
  const auto moment = std::chrono::steady_clock::now();
  // Behind a proxy or a tunnel everybody has one address: guesses lock out no real token.
  const bool locked_out = !logins_.allows(request.remote_addr, moment);
  const auto body = nlohmann::json::parse(text, nullptr, false);
  const bool told = body.is_object() && body.contains("token") && body["token"].is_string();
  const absl::StatusOr<Login> login =
      server_.log_in(told ? body["token"].get<std::string>() : "", request.remote_addr, locked_out);
  if (absl::IsUnauthenticated(login.status())) {
    if (locked_out) {
      return refuse(response, absl::ResourceExhaustedError(
                                  "too many logins from this address were refused; wait a minute"));
    }
    logins_.note_refused(request.remote_addr, moment);
  }
  if (!login.ok()) return refuse_visit(response, login.status());
  const auto valid =
      std::chrono::floor<std::chrono::seconds>(login->principal.expires - std::chrono::system_clock::now());
  response.set_header("Set-Cookie", cookie_of(login->secret, valid, host_->has_tls()));
  response.set_content(principal_json(login->principal), kJson);
}

void Console::call(const std::optional<std::string>& node, const Login& login, const Request& request,
                   const std::string& body, Response& response) {
  const absl::StatusOr<JsonMethod> method = method_in(request);
  if (!method.ok()) return refuse(response, method.status());
  const absl::StatusOr<std::string> hold = hold_in(request);
  if (!hold.ok()) return refuse(response, hold.status());
  Callee callee{.channel = server_.channel(), .title = server_.title(), .login = &login, .hold = *hold};
  if (node) {
    const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = nodes_.to(*node, login);
    if (!channel.ok()) return refuse(response, channel.status());
    callee = {.channel = *channel, .title = fmt::format("node \"{}\"", *node)};
  }
  if (method->streams()) return stream(*method, callee, login, body, response);
  const std::chrono::milliseconds timeout = timeout_of(*method);
  const auto running = JsonCall::start(callee.channel, *method, body, callee.login, callee.hold, timeout);
  if (!running.ok()) return refuse(response, running.status());
  std::string message;
  if ((*running)->next(timeout, message) != JsonCall::Got::kMessage)
    return refuse(response, (*running)->outcome(callee.title));
  response.set_content(message, kJson);
}

void Console::stream(const JsonMethod& method, const Callee& callee, const Login& login,
                     const std::string& body, Response& response) {
  const std::string name = login.principal.name;
  if (!streams_.take(name)) {
    return refuse(response, absl::ResourceExhaustedError(fmt::format(
                                "too many pages of the console are open: \"{}\" may have {} live views, and "
                                "all users together {}; close some",
                                name, StreamPlaces::kMaxOfOne, StreamPlaces::kMax)));
  }
  // Of a stream that is not begun, too.
  const auto place = std::shared_ptr<void>(nullptr, [this, name](void*) { streams_.leave(name); });
  auto running = JsonCall::start(callee.channel, method, body, callee.login, callee.hold, kMaxStream);
  if (!running.ok()) return refuse(response, running.status());
  std::string first;
  if ((*running)->next(kFirstMessage, first) == JsonCall::Got::kEnd) {
    if (const absl::Status status = (*running)->outcome(callee.title); !status.ok())
      return refuse(response, status);
  }
  const auto events = std::make_shared<EventStream>(
      *std::move(running), std::move(first), callee.title,
      [this, secret = login.secret] { return server_.principal_of(secret).status(); });
  response.set_chunked_content_provider("text/event-stream",
                                        [this, events, place](size_t, httplib::DataSink& sink) {
                                          return !stopping_ && events->send_next(sink);
                                        });
}

}  // namespace glasswing
