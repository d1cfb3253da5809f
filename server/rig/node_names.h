// The certificates that own the names of displays and cameras: a name belongs to the certificate that
// registered it first, until it is released. Certificates are identified by their common name, which renewal
// keeps. Stored in node-names.json below the server's data.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <map>
#include <string>

#include "server/storage/problems.h"

namespace glasswing {

// Its owner serialises access.
class NodeNames {
 public:
  static constexpr size_t kMaxNames = 1000;

  // Keeps nothing.
  NodeNames() = default;
  // A damaged file is set aside, and `problems` says so: names then belong to whoever registers them next.
  static absl::StatusOr<NodeNames> open(const std::filesystem::path& data, Problems& problems);

  // The common name of the owner's certificate; empty: nobody owns the name.
  std::string owner(const std::string& name) const;
  // Durable when it returns OK. RESOURCE_EXHAUSTED: kMaxNames are owned.
  absl::Status give(const std::string& name, const std::string& owner);
  // NOT_FOUND: nobody owns the name.
  absl::Status release(const std::string& name);

 private:
  absl::Status store(const std::map<std::string, std::string>& owners);

  std::filesystem::path file_;                 // empty: nothing is stored
  std::map<std::string, std::string> owners_;  // by node's name
};

}  // namespace glasswing
