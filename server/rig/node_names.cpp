#include "server/rig/node_names.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {

absl::StatusOr<NodeNames> NodeNames::open(const std::filesystem::path& data, Problems& problems) {
  NodeNames names;
  names.file_ = data / "node-names.json";
  if (!std::filesystem::exists(names.file_)) return names;
  GW_ASSIGN_OR_RETURN(const std::string text, read_file(names.file_));
  const auto json = nlohmann::json::parse(text, nullptr, false);
  bool good = json.is_object();
  if (good) {
    for (const auto& [name, owner] : json.items()) {
      good = good && owner.is_string();
      if (good) names.owners_[name] = owner.get<std::string>();
    }
  }
  if (good) return names;
  GW_RETURN_IF_ERROR(problems.set_aside(data, names.file_,
                                        absl::DataLossError("it is not a JSON object of strings"),
                                        "names of displays and cameras belong to whoever registers them "
                                        "next"));
  names.owners_.clear();
  return names;
}

std::string NodeNames::owner(const std::string& name) const {
  const auto found = owners_.find(name);
  return found == owners_.end() ? "" : found->second;
}

absl::Status NodeNames::give(const std::string& name, const std::string& owner) {
  if (owners_.size() >= kMaxNames && !owners_.contains(name)) {
    return absl::ResourceExhaustedError(fmt::format(
        "{} names of nodes are owned, the maximum; free unused ones: glasswing nodes release NAME",
        kMaxNames));
  }
  std::map<std::string, std::string> owners = owners_;
  owners[name] = owner;
  return store(owners);
}

absl::Status NodeNames::release(const std::string& name) {
  std::map<std::string, std::string> owners = owners_;
  if (owners.erase(name) == 0)
    return absl::NotFoundError(fmt::format("no certificate owns the name \"{}\"", name));
  return store(owners);
}

absl::Status NodeNames::store(const std::map<std::string, std::string>& owners) {
  if (!file_.empty()) {
    const std::string text =
        nlohmann::json(owners).dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
    GW_RETURN_IF_ERROR(write_file_durably(file_, text + "\n"));
  }
  owners_ = owners;
  return absl::OkStatus();
}

}  // namespace glasswing
