#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/rpc.h"
#include "core/base/file.h"
#include "core/base/status.h"
#include "core/matte/matte_file.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kFetchTimeout(10);

absl::Status fetch(const Client& client, const std::string& name, const std::string& output) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  grpc::ClientContext context;
  set_deadline(context, kFetchTimeout);
  v1::FetchMatteRequest request;
  request.set_name(name);
  const auto reader = server.stub->FetchMatte(&context, request);
  std::string bytes;
  for (v1::FetchMatteResponse response; reader->Read(&response);) bytes += response.chunk();
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return status_from(status, server.title);
  const absl::StatusOr<Matte> matte = decode_matte(bytes);
  if (!matte.ok()) {
    return absl::Status(matte.status().code(), fmt::format("the matte of session {} came damaged: {}", name,
                                                           std::string(matte.status().message())));
  }
  GW_RETURN_IF_ERROR(write_file_durably(output, bytes));
  const auto& warnings = matte->metadata.warnings();
  if (client.json) {
    nlohmann::ordered_json written = {{"session", name},
                                      {"file", output},
                                      {"bytes", bytes.size()},
                                      {"width_px", matte->width_px()},
                                      {"height_px", matte->height_px()}};
    if (!warnings.empty()) written["warnings"] = std::vector<std::string>(warnings.begin(), warnings.end());
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: the matte of session {}, {}x{}\n", output, name, matte->width_px(),
                             matte->height_px());
    for (const std::string& warning : warnings) std::cout << fmt::format("warning: {}\n", warning);
  }
  return absl::OkStatus();
}

}  // namespace

void add_fetch_command(CLI::App& app, Client& client) {
  struct Arguments {
    std::string session;
    std::string output;
  };
  CLI::App& command = *app.add_subcommand("fetch", "Fetch a finished matte.");
  command.footer("Example:\n  glasswing fetch vase -o vase.exr");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command.add_option("-o,--output", arguments->output, "the OpenEXR file to write")->required();
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return fetch(client, arguments->session, arguments->output); };
  });
}

}  // namespace glasswing
