#include "console/routes/console.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "console/routes/cookies.h"
#include "console/routes/json_call.h"
#include "core/composite/stmap.h"
#include "core/file/file.h"
#include "core/frame/archive_json.h"
#include "core/matte/matte_file.h"
#include "core/security/tls.h"
#include "core/service/service.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "server/console/console_service.h"
#include "tests/console/rays/straight_mattes.h"
#include "tests/core/archive/made_archive.h"
#include "tests/core/security/made_certificates.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using nlohmann::json;

// A server with one session, "vase", whose matte is arbitrary bytes.
class Sessions final : public v1::SessionService::Service {
 public:
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* response) override {
    if (mattes.contains(request->name())) {
      response->mutable_session()->set_name(request->name());
      response->mutable_session()->set_pixel_count(pixel_count);
      return grpc::Status::OK;
    }
    if (request->name() != "vase") return {grpc::StatusCode::NOT_FOUND, "there is no session"};
    response->mutable_session()->set_name("vase");
    response->mutable_session()->set_archive_bytes(1LL << 40);
    response->mutable_session()->set_archive_address(archive_address);
    response->mutable_session()->set_state(state);
    return grpc::Status::OK;
  }
  // Two changes, then silence until the caller has left.
  grpc::Status WatchSession(grpc::ServerContext* context, const v1::WatchSessionRequest* request,
                            grpc::ServerWriter<v1::WatchSessionResponse>* writer) override {
    for (const int proven : {1, 2}) {
      v1::WatchSessionResponse response;
      response.mutable_session()->set_proven_count(proven);
      writer->Write(response);
    }
    if (request->name() == "short") return {grpc::StatusCode::DATA_LOSS, "gone"};
    while (!context->IsCancelled()) std::this_thread::yield();
    left = true;
    left.notify_all();
    return grpc::Status::CANCELLED;
  }
  grpc::Status PauseSession(grpc::ServerContext* context, const v1::PauseSessionRequest*,
                            v1::PauseSessionResponse*) override {
    const auto found = context->client_metadata().find("glasswing-hold");
    hold = found == context->client_metadata().end()
               ? ""
               : std::string(found->second.data(), found->second.size());
    return grpc::Status::OK;
  }
  grpc::Status BeginImport(grpc::ServerContext*, const v1::BeginImportRequest* request,
                           v1::BeginImportResponse* response) override {
    v1::CreateArchiveRequest create;
    *create.mutable_manifest() = request->manifest();
    create.set_import_token("secret of " + request->name());
    response->set_import_token(create.import_token());
    grpc::ClientContext context;
    v1::CreateArchiveResponse created;
    return v1::ArchiveService::NewStub(dial(archive_address))->CreateArchive(&context, create, &created);
  }
  grpc::Status FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest* request,
                          grpc::ServerWriter<v1::FetchMatteResponse>* writer) override {
    v1::FetchMatteResponse response;
    if (const auto found = mattes.find(request->name()); found != mattes.end()) {
      ++fetching;
      fetching.notify_all();
      held.wait(true);
      response.set_chunk(found->second);
      writer->Write(response);
      return grpc::Status::OK;
    }
    for (const char* part : {"all the ", "bytes of "}) {
      response.set_chunk(part);
      writer->Write(response);
    }
    response.set_chunk(request->has_frame()    ? std::to_string(request->frame())
                       : request->has_region() ? request->region().ShortDebugString()
                                               : request->name());
    writer->Write(response);
    return grpc::Status::OK;
  }

  std::atomic<bool> left = false;
  std::string archive_address;
  v1::SessionState state = v1::SESSION_STATE_UNSPECIFIED;  // of "vase"
  std::map<std::string, std::string> mattes;               // by session
  std::int64_t pixel_count = 0;                            // of these sessions' pictures
  std::atomic<int> fetching = 0;                           // calls for them, ended ones too
  std::atomic<bool> held = false;                          // they are not answered yet
  std::string hold = "not called";                         // that the last PauseSession belonged to
};

// Knows one camera node, "camera-1".
class Nodes final : public v1::NodeService::Service {
 public:
  grpc::Status ListNodes(grpc::ServerContext*, const v1::ListNodesRequest*,
                         v1::ListNodesResponse* response) override {
    v1::Node& node = *response->add_nodes();
    node.set_name("camera-1");
    node.set_address(address);
    return grpc::Status::OK;
  }

  std::string address;
};

class Camera final : public v1::CameraService::Service {
 public:
  grpc::Status GetCamera(grpc::ServerContext* context, const v1::GetCameraRequest*,
                         v1::GetCameraResponse*) override {
    EXPECT_FALSE(context->client_metadata().contains(kLoginMetadata)) << "logins are the server's";
    return grpc::Status::OK;
  }
};

class ConsoleTest : public testing::Test {
 protected:
  ConsoleTest() { std::filesystem::create_directories(scratch_ / "page/assets"); }
  ~ConsoleTest() override {
    console_.reset();
    server_.reset();
    (void)use_tls({});
  }

  void start() {
    (void)write_file_durably(scratch_ / "page/index.html", "<!doctype html>");
    (void)write_file_durably(scratch_ / "secret", "not of the page");
    tokens_ = AccessTokens::open(scratch_, problems_).value();
    console_service_ = std::make_unique<ConsoleServiceImpl>(*tokens_);
    camera_host_ = ServiceHost::start({}, {&camera_}).value();
    nodes_.address = camera_host_->address();
    start_server({});
    link_ = std::make_unique<ServerLink>(server_->address());
    console_ = Console::start({"127.0.0.1:0", scratch_ / "page"}, *link_).value();
  }
  void start_server(const ListenOptions& listen) {
    server_ = ServiceHost::start(listen, {&sessions_, &nodes_, console_service_.get()},
                                 [this](const std::string& login) {
                                   return tokens_->principal_of(login, AccessTokens::current_time());
                                 })
                  .value();
  }
  httplib::Client client() const {
    httplib::Client client(console_->url());
    client.set_default_headers({{"X-Glasswing", "console"}});
    return client;
  }
  AccessTokens::Made made(const std::string& role) const {
    const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
    return tokens_->make({"lab"}, "anna", role, now + std::chrono::hours(1), now).value();
  }
  std::string token(const std::string& role) const { return made(role).secret; }
  // A client with the cookie of a logged-in user.
  httplib::Client logged_in(const std::string& role) const { return logged_in(made(role)); }
  httplib::Client logged_in(const AccessTokens::Made& made) const {
    httplib::Client client = this->client();
    const auto response = client.Post("/login", json{{"token", made.secret}}.dump(), "application/json");
    EXPECT_EQ(response->status, 200);
    const std::string cookie = response->get_header_value("Set-Cookie");
    client.set_default_headers({{"X-Glasswing", "console"}, {"Cookie", cookie.substr(0, cookie.find(';'))}});
    return client;
  }

  Problems problems_;
  const TemporaryDirectory scratch_;
  Sessions sessions_;
  Nodes nodes_;
  Camera camera_;
  std::unique_ptr<AccessTokens> tokens_;
  std::unique_ptr<ConsoleServiceImpl> console_service_;
  std::unique_ptr<ServiceHost> camera_host_, server_;
  std::unique_ptr<ServerLink> link_;
  std::unique_ptr<Console> console_;
};

json body_of(const httplib::Result& result) {
  return json::parse(result->body);
}

TEST_F(ConsoleTest, AFolderWithoutThePageSaysSoUntilItHasIt) {
  start();
  const std::filesystem::path page = scratch_ / "page/index.html";
  std::filesystem::remove(page);
  const auto empty = client().Get("/");
  ASSERT_TRUE(empty);
  EXPECT_EQ(empty->status, 404);
  EXPECT_NE(empty->body.find((scratch_ / "page").string() + " has no index.html"), std::string::npos)
      << empty->body;
  ASSERT_OK(write_file_durably(page, "<!doctype html>"));
  EXPECT_EQ(client().Get("/")->status, 200);
}

TEST_F(ConsoleTest, NobodyIsAnsweredButThePageBeforeLoggingIn) {
  start();
  httplib::Client stranger = client();
  for (const char* path : {"/me", "/mattes/vase.exr", "/frames/vase/000000.tif", "/pixels/vase?x=0&y=0"})
    EXPECT_EQ(stranger.Get(path)->status, 401) << path;
  for (const char* path :
       {"/api/SessionService/GetSession", "/api/nodes/a/CameraService/Preview", "/plans", "/images"})
    EXPECT_EQ(stranger.Post(path, "{}", "application/json")->status, 401) << path;
  for (const char* text : {R"({"token": "x.y"})", R"({"token": 5})", R"(["token"])", "token"})
    EXPECT_EQ(stranger.Post("/login", text, "application/json")->status, 401) << text;
  EXPECT_EQ(stranger.Post("/login", "[", "application/json")->status, 401);
  EXPECT_EQ(stranger.Get("/")->body, "<!doctype html>");
  EXPECT_EQ(stranger.Get("/../secret")->status, 404);
}

TEST_F(ConsoleTest, ACookieIsForTheBrowserAloneAndGoesAtLogout) {
  start();
  httplib::Client anna = logged_in("viewer");
  EXPECT_EQ(body_of(anna.Get("/me"))["name"], "anna");
  EXPECT_EQ(body_of(anna.Get("/me"))["role"], "viewer");
  const auto in = client().Post("/login", json{{"token", token("viewer")}}.dump(), "application/json");
  for (const char* word : {"HttpOnly", "SameSite=Strict", "Path=/"})
    EXPECT_NE(in->get_header_value("Set-Cookie").find(word), std::string::npos) << word;
  EXPECT_NE(anna.Post("/logout")->get_header_value("Set-Cookie").find("Max-Age=0"), std::string::npos);
}

TEST_F(ConsoleTest, RefusedLoginsAreSlowedDown) {
  start();
  const auto status = [&](const std::string& token) {
    return client().Post("/login", json{{"token", token}}.dump(), "application/json")->status;
  };
  for (int i = 0; i < LoginLimit::kMaxRefused; ++i) EXPECT_EQ(status("guess"), 401);
  EXPECT_EQ(status("guess"), 429);
  EXPECT_EQ(status(token("viewer")), 200) << "others have the same address";
  EXPECT_EQ(status("guess"), 429);
}

TEST_F(ConsoleTest, ACopiedCookieIsRefusedAfterLogout) {
  start();
  const AccessTokens::Made link = made("operator");
  httplib::Client anna = logged_in(link), elsewhere = logged_in(link);
  EXPECT_EQ(anna.Get("/me")->status, 200);
  EXPECT_EQ(anna.Post("/logout")->status, 200);
  EXPECT_EQ(anna.Get("/me")->status, 401);  // this client still sends the cookie
  EXPECT_EQ(anna.Post("/api/SessionService/GetSession", R"({"name": "vase"})", "application/json")->status,
            401);
  EXPECT_EQ(elsewhere.Get("/me")->status, 200);
}

TEST_F(ConsoleTest, ATokenMadeThroughTheConsoleEndsWithItsMakers) {
  start();
  const AccessTokens::Made own = made("operator");
  httplib::Client anna = logged_in(own);
  const auto response =
      anna.Post("/api/ConsoleService/CreateToken",
                R"({"name": "berta", "role": "operator", "valid_hours": 8760})", "application/json");
  ASSERT_EQ(response->status, 200) << response->body;
  const json answer = body_of(response);
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const std::vector<AccessToken> valid = tokens_->list(now).value();
  ASSERT_EQ(valid.size(), 2u);
  EXPECT_EQ(valid[1].expires, own.token.expires) << "an hour, not a year";
  EXPECT_EQ(std::ranges::count(valid, "anna (console)", &AccessToken::made_by), 1);
  httplib::Client berta = client();
  EXPECT_EQ(berta.Post("/login", json{{"token", answer["token"]}}.dump(), "application/json")->status, 200);
  EXPECT_EQ(
      anna.Post("/api/ConsoleService/RevokeToken", json{{"id", own.token.id}}.dump(), "application/json")
          ->status,
      200);
  EXPECT_EQ(berta.Post("/login", json{{"token", answer["token"]}}.dump(), "application/json")->status, 401);
  EXPECT_EQ(anna.Get("/me")->status, 401) << "it was her own";
}

TEST_F(ConsoleTest, AnEndedLoginEndsItsStreams) {
  start();
  const AccessTokens::Made link = made("viewer");
  httplib::Client anna = logged_in(link);
  httplib::Request request;
  request.method = "POST";
  request.path = "/api/SessionService/WatchSession";
  request.body = "{}";
  std::string seen;
  request.content_receiver = [&](const char* bytes, size_t size, std::uint64_t, std::uint64_t) {
    seen.append(bytes, size);
    if (seen.ends_with("\"provenCount\":2}}\n\n")) {
      EXPECT_OK(tokens_->revoke(link.token.id));
    }
    return true;
  };
  EXPECT_TRUE(anna.send(request)) << "the server ends it";
  EXPECT_NE(seen.find("event: end\ndata: {\"code\":\"UNAUTHENTICATED\""), std::string::npos) << seen;
  sessions_.left.wait(false);
}

TEST_F(ConsoleTest, CallsAreProtobufsJson) {
  start();
  httplib::Client anna = logged_in("viewer");
  const auto get = [&](const std::string& body) {
    return anna.Post("/api/SessionService/GetSession", body, "application/json");
  };
  EXPECT_EQ(body_of(get(R"({"name": "vase"})")),
            (json{{"session", {{"name", "vase"}, {"archiveBytes", "1099511627776"}}}}));
  EXPECT_EQ(get(R"({"name": "urn"})")->status, 404);
  EXPECT_EQ(body_of(get(R"({"name": "urn"})")),
            (json{{"code", "NOT_FOUND"}, {"message", "there is no session"}}));
  EXPECT_EQ(get(R"({"nam": "vase"})")->status, 400);
  EXPECT_EQ(get("[[[[")->status, 400);
  EXPECT_EQ(anna.Post("/api/SessionService/Nothing", "{}", "application/json")->status, 404);
  EXPECT_EQ(anna.Post("/api/FleetService/GetFleet", "{}", "application/json")->status,
            501);  // not served here
}

TEST_F(ConsoleTest, RolesHoldAsForEveryCall) {
  start();
  int refused = 0;
  for (const auto& [role, name] :
       {std::pair(Role::kViewer, "viewer"), std::pair(Role::kOperator, "operator")}) {
    httplib::Client browser = logged_in(name);
    for (const MethodAccess& access : access_table()) {
      const std::string method(access.method);
      const auto found =
          JsonMethod::find(method.substr(0, method.find('/')), method.substr(method.find('/') + 1));
      if (!found.ok() || (access.allows(role) && found->streams())) continue;
      const auto response = browser.Post("/api/" + method, "{}", "application/json");
      EXPECT_EQ(response->status == 403, !access.allows(role)) << method << " as " << name;
      refused += response->status == 403;
    }
  }
  EXPECT_GT(refused, 20);
}

TEST_F(ConsoleTest, CallsCarryTheHoldOfTheirBrowser) {
  start();
  httplib::Client browser = logged_in("operator");
  const auto pause = [&](const httplib::Headers& headers) {
    return browser.Post("/api/SessionService/PauseSession", headers, "{}", "application/json");
  };
  EXPECT_EQ(pause({})->status, 200);
  EXPECT_EQ(sessions_.hold, "");
  EXPECT_EQ(pause({{"X-Glasswing-Hold", "5f3a09c2"}})->status, 200);
  EXPECT_EQ(sessions_.hold, "5f3a09c2");
  for (const std::string& wrong : {std::string("5f 3a"), std::string(129, 'a')}) {
    const auto refused = pause({{"X-Glasswing-Hold", wrong}});
    EXPECT_EQ(refused->status, 400);
    EXPECT_NE(refused->body.find("X-Glasswing-Hold is not a hold's token"), std::string::npos);
  }
}

TEST_F(ConsoleTest, StreamsAreEventsAndEndWithTheirStatus) {
  start();
  httplib::Client anna = logged_in("viewer");
  const auto response =
      anna.Post("/api/SessionService/WatchSession", R"({"name": "short"})", "application/json");
  EXPECT_EQ(response->get_header_value("Content-Type"), "text/event-stream");
  EXPECT_EQ(response->body,
            "data: {\"session\":{\"provenCount\":1}}\n\ndata: {\"session\":{\"provenCount\":2}}\n\n"
            "event: end\ndata: {\"code\":\"DATA_LOSS\",\"message\":\"gone\"}\n\n");
}

TEST_F(ConsoleTest, ABrowserThatLeavesEndsItsCalls) {
  start();
  httplib::Client anna = logged_in("viewer");
  httplib::Request request;
  request.method = "POST";
  request.path = "/api/SessionService/WatchSession";
  request.body = "{}";
  std::string seen;
  request.content_receiver = [&](const char* bytes, size_t size, std::uint64_t, std::uint64_t) {
    seen.append(bytes, size);
    return seen.find("\"provenCount\":2") == std::string::npos;  // then closes the connection
  };
  (void)anna.send(request);
  sessions_.left.wait(false);
}

TEST_F(ConsoleTest, AConsoleThatStopsEndsItsStreams) {
  start();
  httplib::Client anna = logged_in("viewer");
  std::thread watching(
      [&] { (void)anna.Post("/api/SessionService/WatchSession", "{}", "application/json"); });
  console_.reset();
  watching.join();
}

TEST_F(ConsoleTest, OnePersonsStreamsLeaveRoomForOthers) {
  start();
  httplib::Client anna = logged_in("viewer");
  std::vector<std::jthread> pages;
  std::atomic<size_t> open = 0;
  std::atomic<bool> leave = false;
  const auto watch = [&] {
    httplib::Client page = logged_in("viewer");
    httplib::Request request;
    request.method = "POST";
    request.path = "/api/SessionService/WatchSession";
    request.body = "{}";
    request.set_header("Content-Type", "application/json");
    bool is_counted = false;
    request.content_receiver = [&](const char*, size_t, std::uint64_t, std::uint64_t) {
      if (!std::exchange(is_counted, true)) ++open;
      while (!leave) std::this_thread::yield();
      return false;
    };
    (void)page.send(request);
  };
  for (size_t i = 0; i < StreamPlaces::kMaxOfOne; ++i) pages.emplace_back(watch);
  while (open < StreamPlaces::kMaxOfOne) std::this_thread::yield();
  EXPECT_EQ(anna.Post("/api/SessionService/WatchSession", "{}", "application/json")->status, 429);
  EXPECT_EQ(anna.Get("/me")->status, 200);
  leave = true;
  pages.clear();
}

TEST_F(ConsoleTest, MattesCanBeHadInParts) {
  start();
  httplib::Client anna = logged_in("viewer");
  const std::string whole = "all the bytes of vase";
  EXPECT_EQ(anna.Get("/mattes/vase.exr")->body, whole);
  const auto part = anna.Get("/mattes/vase.exr", {{"Range", "bytes=4-8"}});
  EXPECT_EQ(part->status, 206);
  EXPECT_EQ(part->body, whole.substr(4, 5));
  // Many parts, each of which may be all of it, are not sent.
  EXPECT_EQ(anna.Get("/mattes/vase.exr", {{"Range", "bytes=0-,0-,0-"}})->body, whole);
  EXPECT_EQ(anna.Get("/mattes/vase.exr?frame=7")->body, "all the bytes of 7");
  EXPECT_EQ(anna.Get("/mattes/vase.exr?frame=x")->status, 400);
  EXPECT_EQ(anna.Get("/mattes/vase.exr?crop=4x3%2B2%2B1")->body,
            "all the bytes of x_px: 2 y_px: 1 width_px: 4 height_px: 3");
  EXPECT_EQ(anna.Get("/mattes/vase.exr?crop=4x3")->status, 400);
  const std::string tag = anna.Get("/mattes/vase.exr")->get_header_value("ETag");
  EXPECT_EQ(anna.Get("/mattes/vase.exr", {{"If-None-Match", tag}})->status, 304);
}

TEST_F(ConsoleTest, AnStmapIsMadeOfAMatte) {
  start();
  Matte matte(0, 0, 3, 2, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.set_width_px(3);
  matte.metadata.set_height_px(2);
  for (const char* name : {"back", "left"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(40);
    monitor.set_height_px(30);
  }
  for (int x = 0; x < 3; ++x) {
    for (int c = 0; c < 3; ++c)
      matte.modes(x, 1, c)[0] = {
          .weight = 0.5f, .x_px = 4.5f * static_cast<float>(x), .y_px = 7.0f, .texture = 1};
  }
  sessions_.mattes["solved"] = encode_matte(matte).value();
  httplib::Client client = logged_in("viewer");
  const auto stmap = client.Get("/stmaps/solved.exr?monitor=left");
  ASSERT_EQ(stmap->status, 200);
  EXPECT_EQ(stmap->body, encode_stmap(matte, 1, strongest_channel(matte, 1)).value());
  EXPECT_EQ(client.Get("/stmaps/solved.exr")->body,
            encode_stmap(matte, 0, strongest_channel(matte, 0)).value());
  const auto refused = client.Get("/stmaps/solved.exr?monitor=roof");
  EXPECT_EQ(refused->status, 400);
  EXPECT_EQ(body_of(refused)["message"], "the monitor is \"roof\"; this matte has: back, left");
  EXPECT_EQ(body_of(client.Get("/stmaps/vase.exr"))["code"], "DATA_LOSS");
}

TEST_F(ConsoleTest, RaysAreMadeOfTwoSessions) {
  start();
  sessions_.mattes = {{"near", straight_matte("near", 200.0)}, {"far", straight_matte("far", 250.0)}};
  sessions_.pixel_count = kStraightWidth * kStraightHeight;
  httplib::Client client = logged_in("viewer");
  const auto post = [&](const std::string& path, const std::string& text) {
    return client.Post(path.c_str(), {{"X-Glasswing", "console"}}, text, "text/plain");
  };
  const auto geometry = post("/geometries", kStraightGeometry);
  ASSERT_EQ(geometry->status, 200);
  EXPECT_EQ(body_of(geometry)["monitors"][1]["translationMm"], json({-120, -80, 250}));
  const auto made = post("/rays?near=near&far=far", kStraightGeometry);
  ASSERT_EQ(made->status, 200) << made->body;
  const json told = json::parse(made->body.substr(0, made->body.find('\n')));
  EXPECT_EQ(told["counts"]["matched"]["rays"], 3 * kStraightWidth * kStraightHeight);
  const auto file = post("/rays.exr?near=near&far=far", kStraightGeometry);
  ASSERT_EQ(file->status, 200) << file->body;
  EXPECT_EQ(file->get_header_value("Content-Type"), "image/x-exr");
  EXPECT_TRUE(file->body.starts_with("\x76\x2f\x31\x01"));

  const auto refused = [&](const std::string& path, const std::string& text, int status) {
    const auto answer = post(path, text);
    EXPECT_EQ(answer->status, status) << answer->body;
    return body_of(answer)["message"].get<std::string>();
  };
  EXPECT_EQ(refused("/rays?near=near&far=far&far_pose=roof", kStraightGeometry, 404),
            "the geometry has no pose \"roof\" of monitor \"back\"; it has: near, far");
  EXPECT_EQ(refused("/rays?near=near", kStraightGeometry, 400), "far is \"\"; it must name a session");
  EXPECT_EQ(refused("/rays?near=near&far=near", kStraightGeometry, 400),
            "near and far are both \"near\"; they must be two sessions, of monitors at two depths");
  EXPECT_EQ(refused("/rays?near=near&far=cup", kStraightGeometry, 404), "there is no session");
  EXPECT_EQ(refused("/geometries", "camera {", 400).substr(0, 20), "the geometry: line 1");
  sessions_.pixel_count = 4000;
  EXPECT_EQ(refused("/rays?near=near&far=far", kStraightGeometry, 400),
            "the pictures of near have 4000 pixels; the geometry's camera has 16x12, which are 192");
  const auto large = post("/rays?near=near&far=far", std::string(RayRoutes::kMaxGeometry + 1, ' '));
  EXPECT_TRUE(large == nullptr || large->status == 413) << large->status;
}

TEST_F(ConsoleTest, FewPagesWaitForRays) {
  start();
  sessions_.mattes = {{"near", straight_matte("near", 200.0)}, {"far", straight_matte("far", 250.0)}};
  sessions_.held = true;
  const auto make = [this] {
    return logged_in("viewer").Post("/rays?near=near&far=far", {{"X-Glasswing", "console"}},
                                    kStraightGeometry, "text/plain");
  };
  std::vector<std::jthread> pages;
  std::atomic<int> made = 0;
  for (int i = 0; i < RayRoutes::kMaxMakes; ++i) {
    pages.emplace_back([&] {
      if (make()->status == 200) ++made;
    });
  }
  for (int seen = sessions_.fetching; seen < RayRoutes::kMaxMakes; seen = sessions_.fetching)
    sessions_.fetching.wait(seen);
  const auto refused = make();
  EXPECT_EQ(refused->status, 429);
  EXPECT_EQ(body_of(refused)["message"], "4 pages are already waiting for rays; try again in a minute");
  sessions_.held = false;
  sessions_.held.notify_all();
  pages.clear();
  EXPECT_EQ(made, RayRoutes::kMaxMakes);
  EXPECT_EQ(make()->status, 200);
}

TEST_F(ConsoleTest, AnArchiveIsATarFileThatUnpacksToAnArchive) {
  start();
  ArchiveStore store(scratch_ / "node");
  ASSERT_OK(store.prepare());
  v1::CaptureManifest header = MadeArchive::header();
  header.set_session("vase");
  header.add_monitors()->set_name("back");
  header.mutable_monitors(0)->set_width_px(40);
  header.mutable_monitors(0)->set_height_px(30);
  const std::shared_ptr<Archive> archive = store.create(header).value();
  std::vector<Archive::NewFrame> frames(3);
  for (size_t i = 0; i < frames.size(); ++i) {
    frames[i].record.set_step(static_cast<int>(i));
    frames[i].image = Image16(MadeArchive::kWidth, MadeArchive::kHeight);
    std::ranges::fill(frames[i].image.samples, static_cast<std::uint16_t>(1000 * i));
  }
  frames[2].record.set_file("frames/" + std::string(200, 'n') + ".tif");
  ASSERT_OK(archive->add(frames));
  ASSERT_OK(archive->seal());
  ArchiveServiceImpl service(store);
  const auto node = ServiceHost::start({}, {&service}).value();
  sessions_.archive_address = node->address();
  httplib::Client client = logged_in("viewer");

  const auto got = client.Get("/archives/vase.tar");
  ASSERT_EQ(got->status, 200);
  ASSERT_OK(write_file_durably(scratch_ / "vase.tar", got->body));
  ASSERT_EQ(std::system(fmt::format("cd '{}' && tar -xf vase.tar", scratch_.string()).c_str()), 0);
  const std::filesystem::path path = scratch_ / "vase/manifest.json";
  v1::CaptureManifest unpacked;
  ASSERT_OK(parse_archive_json(bytes_of(path), path, &unpacked));
  EXPECT_EQ(unpacked.SerializeAsString(), archive->manifest().SerializeAsString());
  for (const v1::Frame& frame : unpacked.frames())
    EXPECT_EQ(bytes_of(scratch_ / "vase" / frame.file()), archive->read_frame_bytes(frame.file()).value());

  sessions_.state = v1::SESSION_STATE_CAPTURING;
  EXPECT_EQ(body_of(client.Get("/archives/vase.tar"))["code"], "FAILED_PRECONDITION");
  sessions_.state = v1::SESSION_STATE_DONE;
  write_over(scratch_ / "node/vase/frames/000001.tif", 4000, '!');
  EXPECT_FALSE(client.Get("/archives/vase.tar")) << "a damaged frame was sent as if it were whole";
}

TEST_F(ConsoleTest, AnArchiveFromABrowserPassesToTheNodeWhole) {
  start();
  ArchiveStore from(scratch_ / "from");
  ASSERT_OK(from.prepare());
  v1::CaptureManifest header = MadeArchive::header();
  header.set_session("vase");
  header.add_monitors()->set_name("back");
  header.mutable_monitors(0)->set_width_px(40);
  header.mutable_monitors(0)->set_height_px(30);
  const std::shared_ptr<Archive> archive = from.create(header).value();
  std::vector<Archive::NewFrame> frames(3);
  for (size_t i = 0; i < frames.size(); ++i) {
    frames[i].record.set_step(static_cast<int>(i));
    frames[i].image = Image16(MadeArchive::kWidth, MadeArchive::kHeight);
    for (size_t at = 0; at < frames[i].image.samples.size(); ++at)
      frames[i].image.samples[at] = static_cast<std::uint16_t>(977 * at + i);
  }
  ASSERT_OK(archive->add(frames));
  const v1::CaptureManifest whole = archive->manifest();
  const std::string manifest = archive_json(whole, true);
  std::string body;
  for (const v1::Frame& frame : whole.frames())
    body += archive_json(frame, false) + "\n" + archive->read_frame_bytes(frame.file()).value();
  const ArchiveNode node(scratch_ / "to");
  sessions_.archive_address = node.address();
  const auto stored = [&] { return Archive::open(scratch_ / "to/vase").value()->manifest().frames_size(); };
  const auto begin = [](httplib::Client& browser, const std::string& sent) {
    return browser.Post("/imports/vase?camera=camera-1", sent, "application/json");
  };
  const auto put = [](httplib::Client& browser, const std::string& token, const std::string& sent) {
    return browser.Post("/imports/vase/frames", {{"X-Glasswing-Import", token}}, sent,
                        "application/x-frames");
  };

  httplib::Client viewer = logged_in("viewer"), anna = logged_in("operator");
  EXPECT_EQ(begin(viewer, manifest)->status, 403);
  EXPECT_EQ(begin(anna, "{")->status, 400);
  std::string foreign = manifest;
  for (size_t at = 0; (at = foreign.find(".tif", at)) != std::string::npos;) foreign.replace(at, 4, ".png");
  foreign.erase(foreign.rfind(",", foreign.find("record_checksum")), std::string::npos) += "}";
  EXPECT_NE(begin(anna, foreign)->body.find("frames/000000.png is not a file frames/NAME.tif"),
            std::string::npos);
  std::string altered = manifest;
  altered.replace(altered.find("301"), 3, "302");
  EXPECT_NE(begin(anna, altered)->body.find("manifest.json is damaged"), std::string::npos);

  const auto begun = begin(anna, manifest);
  ASSERT_EQ(begun->status, 200) << begun->body;
  const std::string token = body_of(begun)["importToken"];
  EXPECT_EQ(put(viewer, token, body)->status, 403);
  EXPECT_EQ(put(anna, "secret of urn", body)->status, 403);
  EXPECT_EQ(put(anna, "", body)->status, 400);
  std::string damaged = body;
  damaged[damaged.size() - 5] = static_cast<char>(damaged[damaged.size() - 5] ^ 1);
  EXPECT_NE(put(anna, token, damaged)->body.find("frames/000002.tif arrived with checksum"),
            std::string::npos);
  EXPECT_EQ(stored(), 0) << "none of a request with a damaged frame";
  EXPECT_NE(put(anna, token, body.substr(0, body.size() - 1))->body.find("ends within frames/000002.tif"),
            std::string::npos);
  EXPECT_EQ(put(anna, token, body + "{")->status, 400);
  EXPECT_EQ(put(anna, token, std::string(1 << 20, 'x'))->status, 400);
  ASSERT_EQ(put(anna, token, body)->status, 200);
  ASSERT_EQ(stored(), 3);
  for (const v1::Frame& frame : whole.frames())
    EXPECT_EQ(bytes_of(scratch_ / "to/vase" / frame.file()), archive->read_frame_bytes(frame.file()).value());
}

TEST_F(ConsoleTest, PlansAreReadAsTextAndErrorsHaveAPlace) {
  start();
  httplib::Client anna = logged_in("viewer");
  EXPECT_EQ(body_of(anna.Post("/plans", "method: \"ramp\"\nramp { frames: 3 }", "text/plain")),
            (json{{"method", "ramp"}, {"ramp", {{"frames", 3}}}}));
  const auto wrong = anna.Post("/plans", "method: \"ramp\"\nlamp {}", "text/plain");
  EXPECT_EQ(wrong->status, 400);
  EXPECT_NE(wrong->body.find("line 2"), std::string::npos) << wrong->body;
}

TEST_F(ConsoleTest, WhatIsRefusedIsReadToItsEndAndNeverTakenForARequest) {
  start();
  httplib::Client form = client();
  form.set_keep_alive(true);
  const std::string hidden = "POST /logout HTTP/1.1\r\nX-Glasswing: console\r\nContent-Length: 0\r\n\r\n";
  std::string body;
  while (body.size() < (1u << 20)) body += hidden;
  for (const char* path : {"/login", "/plans", "/images", "/api/NodeService/ListNodes", "/nowhere"}) {
    EXPECT_GE(form.Post(path, body, "text/plain")->status, 400) << path;
    // The next answer on this connection must be that of the next request.
    EXPECT_EQ(form.Get("/")->body, "<!doctype html>") << path;
  }
  httplib::Client anna = logged_in("operator");
  EXPECT_EQ(anna.Post("/plans", std::string((8u << 20) + 1, ' '), "text/plain")->status, 413);
  EXPECT_EQ(anna.Get("/me")->status, 200);
}

TEST_F(ConsoleTest, LongPathsAreOnlyNotFound) {
  start();
  httplib::Client anna = logged_in("viewer");
  for (const char* before : {"/mattes/", "/frames/s/", "/pixels/", "/api/nodes/", "/", "/assets/"}) {
    const std::string path = before + std::string(8000, 'a');
    EXPECT_GE(anna.Get(path)->status, 400) << before;
    EXPECT_GE(anna.Post(path, "{}", "application/json")->status, 400) << before;
  }
}

TEST_F(ConsoleTest, OtherPagesGetNothing) {
  start();
  httplib::Client anna = logged_in("operator");
  const std::string host = console_->url().substr(7);
  EXPECT_EQ(anna.Get("/me", {{"Sec-Fetch-Site", "cross-site"}})->status, 403);
  EXPECT_EQ(anna.Get("/me", {{"Sec-Fetch-Site", "same-site"}})->status, 403);
  EXPECT_EQ(anna.Get("/me", {{"Sec-Fetch-Site", "same-origin"}})->status, 200);
  EXPECT_EQ(anna.Get("/me", {{"Origin", "http://evil.example"}})->status, 403);
  EXPECT_EQ(anna.Get("/me", {{"Origin", "null"}})->status, 403);
  EXPECT_EQ(anna.Get("/me", {{"Origin", "http://" + host}})->status, 200);
  EXPECT_EQ(anna.Get("/me", {{"Host", "evil.example:7480"}})->status, 403);
  httplib::Client form = client();  // a form cannot send our header
  form.set_default_headers({});
  EXPECT_EQ(form.Post("/login", json{{"token", token("operator")}}.dump(), "text/plain")->status, 403);
}

TEST_F(ConsoleTest, ThePageRunsNothingOfOthers) {
  start();
  const std::string policy = client().Get("/")->get_header_value("Content-Security-Policy");
  EXPECT_NE(policy.find("default-src 'none'"), std::string::npos);
  EXPECT_NE(policy.find("script-src 'self';"), std::string::npos);
  EXPECT_EQ(policy.find("unsafe"), std::string::npos);
}

TEST_F(ConsoleTest, BeyondThisMachineItNeedsTls) {
  start();
  for (const ConsoleOptions& options :
       {ConsoleOptions{"0.0.0.0:0", scratch_}, ConsoleOptions{"0.0.0.0:0", scratch_, "rig.lab:7480"},
        ConsoleOptions{"7480", scratch_}})
    EXPECT_EQ(Console::start(options, *link_).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ConsoleTest, EveryMethodThatPeopleMayCallIsLinked) {
  for (const MethodAccess& access : access_table()) {
    if (!access.allows(Role::kOperator)) continue;
    const size_t slash = access.method.find('/');
    const auto found = JsonMethod::find(std::string(access.method.substr(0, slash)),
                                        std::string(access.method.substr(slash + 1)));
    EXPECT_FALSE(absl::IsNotFound(found.status())) << access.method;
  }
}

TEST_F(ConsoleTest, AtNodesPeopleLookOnly) {
  start();
  for (const char* role : {"viewer", "operator"}) {
    httplib::Client anna = logged_in(role);
    const auto status = [&](const std::string& method) {
      return anna.Post("/api/nodes/camera-1/" + method, "{}", "application/json")->status;
    };
    EXPECT_EQ(status("CameraService/GetCamera"), 200);
    EXPECT_EQ(status("ArchiveService/ListArchives"), 501);
    EXPECT_EQ(status("CameraService/Capture"), 403);
    EXPECT_EQ(status("SessionService/ListSessions"), 403) << "the server's";
    EXPECT_EQ(anna.Post("/api/nodes/camera-2/CameraService/GetCamera", "{}", "application/json")->status,
              404);
  }
}

TEST_F(ConsoleTest, WhileTheServerIsAwayItSaysSoAndThenGoesOn) {
  start();
  httplib::Client anna = logged_in("viewer");
  const std::string address = server_->address();
  server_.reset();
  const auto away = anna.Get("/me");
  EXPECT_EQ(away->status, 503);
  EXPECT_TRUE(away->has_header("Retry-After"));
  EXPECT_EQ(body_of(away)["message"], "the server at " + address + " does not answer");
  for (int i = 0; i <= LoginLimit::kMaxRefused; ++i)
    EXPECT_EQ(client().Post("/login", R"({"token": "x"})", "application/json")->status, 503);
  EXPECT_EQ(client().Get("/")->status, 200);
  start_server({.address = address});
  while (anna.Get("/me")->status == 503) std::this_thread::yield();
  EXPECT_EQ(body_of(anna.Get("/me"))["name"], "anna");
  EXPECT_EQ(logged_in("operator").Get("/me")->status, 200) << "nobody has to wait";
}

TEST_F(ConsoleTest, ACookieThatIsNoSecretIsNotSentOn) {
  start();
  for (const std::string& cookie : {std::string("a b"), std::string("a\xc3"), std::string(5000, 'a')}) {
    httplib::Client anna = client();
    EXPECT_EQ(anna.Get("/me", {{"Cookie", fmt::format("{}={}", kConsoleCookie, cookie)}})->status, 401);
  }
}

TEST_F(ConsoleTest, OverTlsCookiesAreSecureAndCertificatesOfBrowsersAreNotAskedFor) {
  const MadeCertificate ca = make_certificate("ca");
  const auto write = [&](const std::string& file, const std::string& pem) {
    EXPECT_OK(write_file_durably(scratch_ / file, pem));
    return (scratch_ / file).string();
  };
  // Of the test's own process: the server's certificate, the node's and the console's.
  const MadeCertificate own = make_certificate(
      "rig", &ca, fmt::format("IP:127.0.0.1,URI:{0}server,URI:{0}console,URI:{0}camera", kRoleUri));
  ASSERT_OK(use_tls({write("ca.pem", ca.certificate_pem()), write("own.pem", own.certificate_pem()),
                     write("own.key", own.key_pem())}));
  start();
  EXPECT_TRUE(console_->url().starts_with("https://"));
  const MadeCertificate berta = make_certificate("berta", &ca, fmt::format("URI:{}operator", kRoleUri));
  httplib::Client browser(console_->url(), write("v.pem", berta.certificate_pem()),
                          write("v.key", berta.key_pem()));
  browser.set_ca_cert_path((scratch_ / "ca.pem").c_str());
  browser.set_default_headers({{"X-Glasswing", "console"}});
  EXPECT_EQ(browser.Get("/me")->status, 401);
  const auto in = browser.Post("/login", json{{"token", token("viewer")}}.dump(), "application/json");
  const std::string cookie = in->get_header_value("Set-Cookie");
  EXPECT_NE(cookie.find("Secure"), std::string::npos);
  browser.set_default_headers({{"X-Glasswing", "console"}, {"Cookie", cookie.substr(0, cookie.find(';'))}});
  EXPECT_EQ(body_of(browser.Get("/me"))["role"], "viewer");
  const auto status = [&](const std::string& method) {
    return browser.Post("/api/" + method, R"({"name": "vase"})", "application/json")->status;
  };
  EXPECT_EQ(status("SessionService/GetSession"), 200);
  EXPECT_EQ(status("SessionService/DeleteSession"), 403);
  EXPECT_EQ(browser.Post("/api/nodes/camera-1/CameraService/GetCamera", "{}", "application/json")->status,
            200);
  const std::string address = server_->address();
  server_.reset();
  EXPECT_EQ(browser.Get("/me")->status, 503);
  start_server({.address = address});
  while (browser.Get("/me")->status == 503) std::this_thread::yield();
  EXPECT_EQ(browser.Get("/me")->status, 200);
}

}  // namespace
}  // namespace glasswing
