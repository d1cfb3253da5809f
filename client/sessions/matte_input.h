// Mattes that a command reads: files, or from sessions.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <string>

#include "client/cli/client.h"
#include "client/cli/rpc.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/matte/matte_file.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {

// Appends a matte to a file as it arrives. `waiting`: shows the progress.
absl::Status stream_matte(const Peer<v1::SessionService>& server, const v1::FetchMatteRequest& request,
                          FileWriter& writer, Waiting* waiting = nullptr);

// A file, or the name of a session.
struct MatteInput {
  std::string name;
  // Session names contain neither.
  bool is_file() const { return name.ends_with(".exr") || name.find('/') != std::string::npos; }
  // The matte file, unchecked. A session's matte is streamed to a file beside `output` that is already
  // unlinked when this returns, so mattes are never completely in memory and never left on the disk.
  absl::StatusOr<std::shared_ptr<const MappedFile>> open(const Client& client,
                                                         const std::filesystem::path& output) const;
  // An error about the matte's content, with its name.
  absl::Status error(const absl::Status& status) const;
};

// MatteInput::open(), decoded.
absl::StatusOr<Matte> read_matte_input(const Client& client, const std::string& name,
                                       const std::filesystem::path& output,
                                       Pyramids pyramids = Pyramids::kDropped);

}  // namespace glasswing
