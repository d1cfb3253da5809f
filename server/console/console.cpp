#include "server/console/console.h"

#include <fmt/format.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>
#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/service/service.h"
#include "glasswing/v1/plan.pb.h"
#include "server/console/json_call.h"
#include "server/console/principals.h"

namespace glasswing {
namespace {

namespace pb = google::protobuf;
using httplib::Request;
using httplib::Response;

constexpr std::chrono::hours kMaxStream(24);
constexpr std::chrono::milliseconds kKeepAliveInterval(5000), kPollInterval(250);
constexpr size_t kMaxJson = size_t{8} << 20, kMaxImage = size_t{64} << 20, kMaxToken = 4096;
constexpr const char* kJson = "application/json";

std::string json_of(const Principal& principal) {
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

// What a call says of its caller: the name, for people, and what bounds the tokens that it may make
// (ConsoleService).
JsonCall::Metadata caller_metadata(const Principal& principal) {
  JsonCall::Metadata metadata{
      {"glasswing-client", principal.name + " (console)"},
      {"glasswing-expires", std::to_string(principal.expires.time_since_epoch().count())}};
  if (!principal.token.empty()) metadata.emplace_back("glasswing-token", principal.token);
  return metadata;
}

// The last event of a stream.
bool send_end(httplib::DataSink& sink, const absl::Status& status) {
  const std::string event = fmt::format("event: end\ndata: {}\n\n", glasswing::json_of(status));
  sink.write(event.data(), event.size());
  sink.done();
  return true;
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
  if (path == "/plans" || path.starts_with("/api/")) return kMaxJson;
  return std::nullopt;
}

}  // namespace

std::filesystem::path default_console_files() {
  std::error_code error;
  const std::filesystem::path root =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path().parent_path();
  const std::filesystem::path installed = root / "share/glasswing/console";
  return std::filesystem::exists(installed) ? installed : root / "console";
}

absl::StatusOr<std::unique_ptr<Console>> Console::start(const ConsoleOptions& options, AccessTokens& tokens,
                                                        std::shared_ptr<grpc::Channel> server) {
  std::unique_ptr<Console> self(new Console(tokens, std::move(server)));
  GW_ASSIGN_OR_RETURN(self->host_, HttpHost::bind(options.address));
  const std::string& bound = self->host_->address();
  const size_t colon = bound.rfind(':');
  const std::string host = bound.substr(0, colon);
  const bool every = host == "0.0.0.0" || host == "[::]";
  self->url_ = fmt::format("{}://{}{}", self->host_->has_tls() ? "https" : "http",
                           every && !options.name.empty() ? options.name : host, bound.substr(colon));
  self->add_routes(options.files);
  self->host_->serve();
  return self;
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
  routes.Post("/logout", guarded(kMaxToken, [this](const Principal& principal, const Request&,
                                                   const std::string&, Response& response) {
                if (const absl::Status status = tokens_.log_out(principal); !status.ok())
                  return refuse(response, status);
                spdlog::info("audit console logout caller=\"{}\"", principal.title());
                response.set_header("Set-Cookie", cookie_of("", std::chrono::seconds(0), host_->has_tls()));
                response.set_content("{}", kJson);
              }));
  routes.Get("/me", guarded([](const Principal& principal, const Request&, Response& response) {
               response.set_content(json_of(principal), kJson);
             }));
  routes.Post(R"(/api/nodes/([A-Za-z0-9._-]+)/(\w+)/(\w+))",
              guarded(kMaxJson, [this](const Principal& principal, const Request& request,
                                       const std::string& body, Response& response) {
                const std::string node = request.matches[1];
                const auto channel = nodes_.to(node);
                if (!channel.ok()) return refuse(response, channel.status());
                call(*channel, fmt::format("node \"{}\"", node), principal, request, body, response);
              }));
  routes.Post(R"(/api/(\w+)/(\w+))",
              guarded(kMaxJson, [this](const Principal& principal, const Request& request,
                                       const std::string& body, Response& response) {
                call(server_, "the server", principal, request, body, response);
              }));
  routes.Post("/plans", guarded(kMaxJson, [](const Principal&, const Request&, const std::string& body,
                                             Response& response) { parse_plan(body, response); }));
  routes.Post("/images", guarded(kMaxImage, [this](const Principal& principal, const Request&,
                                                   const std::string& body, Response& response) {
                sessions_.store_image(principal, body, response);
              }));
  routes.Get(R"(/mattes/([A-Za-z0-9._-]+)\.exr)",
             guarded([this](const Principal& principal, const Request& request, Response& response) {
               sessions_.send_matte(principal, request, response);
             }));
  routes.Get(R"(/frames/([A-Za-z0-9._-]+)/(\w+)\.(tif|jpg))",
             guarded([this](const Principal& principal, const Request& request, Response& response) {
               sessions_.send_frame(principal, request, response);
             }));
  routes.Get(R"(/pixels/([A-Za-z0-9._-]+))",
             guarded([this](const Principal& principal, const Request& request, Response& response) {
               sessions_.send_samples(principal, request, response);
             }));
  routes.set_mount_point(
      "/assets", (files / "assets").string(),
      {{"Cache-Control", "public, max-age=31536000, immutable"}});  // names include checksums
  if (!routes.set_mount_point("/", files.string(), {{"Cache-Control", "no-cache"}})) {
    routes.Get("/", [files](const Request&, Response& response) {
      response.set_content(
          fmt::format("The console's page is not in {}: build it with Node.js (deploy/build), "
                      "or give its directory by --console-files.\n",
                      files.string()),
          "text/plain");
    });
  }
  routes.set_exception_handler([](const Request& request, Response& response, std::exception_ptr) {
    spdlog::error("console failed path={}", request.path);
    refuse(response, absl::InternalError("the console could not answer"));
  });
}

absl::StatusOr<Principal> Console::authenticate(const Request& request) const {
  GW_RETURN_IF_ERROR(check_origin(request, host_->has_tls()));
  return principal_of(request, tokens_);
}

httplib::Server::Handler Console::guarded(Handler handler) const {
  return [this, handler = std::move(handler)](const Request& request, Response& response) {
    response.set_header("Cache-Control", "no-store");
    const absl::StatusOr<Principal> principal = authenticate(request);
    if (!principal.ok()) return refuse(response, principal.status());
    handler(*principal, request, response);
  };
}

httplib::Server::HandlerWithContentReader Console::guarded(size_t max_bytes, BodyHandler handler) const {
  return [this, max_bytes, handler = std::move(handler)](const Request& request, Response& response,
                                                         const httplib::ContentReader& content) {
    response.set_header("Cache-Control", "no-store");
    const absl::StatusOr<Principal> principal = authenticate(request);
    const absl::StatusOr<std::string> body = body_of(content, principal.ok() ? max_bytes : 0);
    if (!principal.ok()) return refuse(response, principal.status());
    if (!body.ok()) return refuse(response, body.status());
    handler(*principal, request, *body, response);
  };
}

void Console::log_in(const Request& request, const std::string& text, Response& response) {
  if (const absl::Status status = check_origin(request, host_->has_tls()); !status.ok())
    return refuse(response, status);
  const auto moment = std::chrono::steady_clock::now();
  if (!logins_.allows(request.remote_addr, moment)) {
    return refuse(response, absl::ResourceExhaustedError(
                                "too many logins from this address were refused; wait a minute"));
  }
  const auto body = nlohmann::json::parse(text, nullptr, false);
  const bool told = body.is_object() && body.contains("token") && body["token"].is_string();
  const std::string token = told ? body["token"].get<std::string>() : "";
  const std::chrono::sys_seconds now = AccessTokens::current_time();
  const absl::StatusOr<AccessTokens::Login> login = tokens_.log_in(token, now);
  if (!login.ok()) {
    logins_.note_refused(request.remote_addr, moment);
    spdlog::warn("audit console login refused from={}", request.remote_addr);
    return refuse(response, login.status());
  }
  const Principal& principal = login->principal;
  spdlog::info("audit console login caller=\"{}\" from={}", principal.title(), request.remote_addr);
  response.set_header("Set-Cookie", cookie_of(login->secret, principal.expires - now, host_->has_tls()));
  response.set_content(json_of(principal), kJson);
}

void Console::call(const std::shared_ptr<grpc::Channel>& channel, const std::string& peer,
                   const Principal& principal, const Request& request, const std::string& body,
                   Response& response) const {
  const size_t last = request.matches.size() - 1;
  const absl::StatusOr<JsonMethod> method =
      JsonMethod::find(request.matches[last - 1], request.matches[last]);
  if (!method.ok()) return refuse(response, method.status());
  if (const absl::Status status = admit(method->name(), principal.roles, principal.title()); !status.ok())
    return refuse(response, status);
  const std::string name = principal.name;
  if (method->streams() && !streams_.take(name)) {
    return refuse(response, absl::ResourceExhaustedError(fmt::format(
                                "\"{}\" has {} pages' event streams open, or all have {}: close some", name,
                                StreamPlaces::kMaxOfOne, StreamPlaces::kMax)));
  }
  // Of a stream that is not begun, too.
  const auto place = std::shared_ptr<void>(nullptr, [this, name, is_taken = method->streams()](void*) {
    if (is_taken) streams_.leave(name);
  });
  auto started = JsonCall::start(channel, *method, body, caller_metadata(principal),
                                 method->streams() ? std::chrono::milliseconds(kMaxStream) : kCallTimeout);
  if (!started.ok()) return refuse(response, started.status());
  const std::shared_ptr<JsonCall> running = *std::move(started);
  std::string message;
  if (!method->streams()) {
    if (running->next(kCallTimeout, message) == JsonCall::Got::kMessage)
      return response.set_content(message, kJson);
    return refuse(response, running->outcome(peer));
  }
  const auto send_next = [this, running, place, peer, principal, quiet = std::chrono::milliseconds(0),
                          checked = AccessTokens::current_time()](size_t, httplib::DataSink& sink) mutable {
    std::string event;
    if (const std::chrono::sys_seconds now = AccessTokens::current_time(); now != checked) {
      checked = now;
      if (const absl::Status valid = tokens_.check(principal, now); !valid.ok()) return send_end(sink, valid);
    }
    switch (running->next(kPollInterval, event)) {
      case JsonCall::Got::kMessage:
        event = fmt::format("data: {}\n\n", event);
        break;
      case JsonCall::Got::kNothingYet:
        quiet += kPollInterval;
        if (stopping_ || !sink.is_writable()) return false;
        if (quiet < kKeepAliveInterval) return true;
        event = ": alive\n\n";
        break;
      case JsonCall::Got::kEnd:
        return send_end(sink, running->outcome(peer));
    }
    quiet = std::chrono::milliseconds(0);
    return !stopping_ && sink.write(event.data(), event.size());
  };
  response.set_chunked_content_provider("text/event-stream", send_next);
}

}  // namespace glasswing
