#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "client/cli/rpc.h"
#include "client/storage/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/storage_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr char kServer[] = "server", kNoTag[] = "(none)", kTrash[] = "(trash)";

struct Sum {
  std::string name;
  int sessions = 0;
  std::int64_t frames = 0, copies = 0, mattes = 0;
  std::string ends = {};  // of one session

  std::int64_t total() const { return frames + copies + mattes; }
  void add(const v1::SessionUsage& usage) {
    const auto nodes = static_cast<std::int64_t>(usage.nodes_size());
    ++sessions;
    frames += nodes > 0 ? usage.frame_bytes() : 0;
    copies += nodes > 1 ? (nodes - 1) * usage.frame_bytes() : 0;
    mattes += usage.matte_bytes();
  }
};

class Sums {
 public:
  Sum& of(const std::string& name) {
    const auto found = std::ranges::find(sums_, name, &Sum::name);
    return found == sums_.end() ? sums_.emplace_back(Sum{.name = name}) : *found;
  }
  // The largest first.
  std::vector<Sum> sorted() && {
    std::ranges::stable_sort(sums_, std::greater(), &Sum::total);
    return std::move(sums_);
  }

 private:
  std::vector<Sum> sums_;
};

void add_by_node(const v1::SessionUsage& usage, Sums& sums) {
  for (int i = 0; i < usage.nodes_size(); ++i) {
    Sum& node = sums.of(usage.nodes(i));
    ++node.sessions;
    (i == 0 ? node.frames : node.copies) += usage.frame_bytes();
  }
  if (usage.matte_bytes() == 0) return;
  ++sums.of(kServer).sessions;
  sums.of(kServer).mattes += usage.matte_bytes();
}

std::vector<Sum> summed(const v1::GetUsageResponse& all, const std::string& by) {
  Sums sums;
  for (const v1::SessionUsage& usage : all.sessions()) {
    if (by == "node") {
      add_by_node(usage, sums);
    } else if (by == "session") {
      sums.of(usage.name()).add(usage);
      sums.of(usage.name()).ends = usage.ends();
    } else if (!usage.deleted().empty()) {
      sums.of(kTrash).add(usage);
    } else if (by == "series") {
      sums.of(usage.series()).add(usage);
    } else {
      for (const std::string& tag : usage.tags()) sums.of(tag).add(usage);
      if (usage.tags().empty()) sums.of(kNoTag).add(usage);
    }
  }
  return std::move(sums).sorted();
}

std::string text_of(std::int64_t bytes) {
  return bytes == 0 ? "" : bytes_text(static_cast<double>(bytes));
}

void print(const Client& client, const std::string& by, const std::vector<Sum>& sums, const Sum& total) {
  if (client.json) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (const Sum& sum : sums) {
      rows.push_back({{by, sum.name},
                      {"sessions", sum.sessions},
                      {"frame_bytes", sum.frames},
                      {"copy_bytes", sum.copies},
                      {"matte_bytes", sum.mattes},
                      {"bytes", sum.total()},
                      {"ends", sum.ends}});
    }
    std::cout << nlohmann::ordered_json{{"by", by}, {"rows", rows}, {"bytes", total.total()}}.dump(1) << "\n";
    return;
  }
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](const Sum& sum) {
    rows.push_back({sum.name, fmt::to_string(sum.sessions), text_of(sum.frames), text_of(sum.copies),
                    text_of(sum.mattes), text_of(sum.total()), sum.ends});
  };
  for (const Sum& sum : sums) add(sum);
  if (!client.tsv) add(total);
  std::string title = by;
  std::ranges::transform(title, title.begin(), [](char c) { return c >= 'a' ? c - 'a' + 'A' : c; });
  print_table(client,
              {{title},
               {"SESSIONS", true},
               {"FRAMES", true},
               {"COPIES", true},
               {"MATTES", true},
               {"TOTAL", true},
               {"ENDS"}},
              rows);
}

absl::Status show_usage(const Client& client, const std::string& by) {
  const Peer<v1::StorageService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::GetUsageResponse all,
                      call_pages(server, &v1::StorageService::Stub::GetUsage, {}, kLongCallTimeout));
  Sum total{.name = "total"};
  for (const v1::SessionUsage& usage : all.sessions()) total.add(usage);
  print(client, by, summed(all, by), total);
  return absl::OkStatus();
}

}  // namespace

void add_du_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("du", "Say what sessions take on disk, the largest first.");
  command.footer(
      "A session in several tags counts in each; the total counts it once. ENDS is when a session leaves the "
      "trash, or\nwhen the server's rules remove its frames.\n\n"
      "Examples:\n  glasswing du\n  glasswing du --by series\n  glasswing du --by node --json");
  auto by = std::make_shared<std::string>("session");
  command.add_option("--by", *by, "what the rows are: session, series, tag or node")
      ->check(CLI::IsMember({"session", "series", "tag", "node"}))
      ->capture_default_str();
  command.callback([&client, by] { client.run = [&client, by] { return show_usage(client, *by); }; });
}

}  // namespace glasswing
