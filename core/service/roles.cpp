#include "core/service/roles.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <grpc/grpc_security_constants.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <vector>

namespace glasswing {
namespace {

constexpr unsigned bit(Role role) {
  return 1u << static_cast<unsigned>(role);
}
constexpr unsigned kOperator = bit(Role::kOperator), kServer = bit(Role::kServer),
                   kCamera = bit(Role::kCamera), kSolver = bit(Role::kSolver);
constexpr unsigned kPeople = kOperator | bit(Role::kViewer);
constexpr unsigned kNodes = bit(Role::kDisplay) | kCamera | kSolver;
constexpr unsigned kAnybody = kPeople | kServer | kNodes;
constexpr bool kAudited = true;

constexpr MethodAccess kTable[] = {
    {"ArchiveService/CreateArchive", kServer},
    {"ArchiveService/GetManifest", kPeople | kServer | kCamera | kSolver},
    {"ArchiveService/ReadRows", kServer | kCamera | kSolver},
    {"ArchiveService/ReadFile", kPeople | kServer | kCamera | kSolver},
    {"ArchiveService/PutFrame", kOperator, kAudited},
    {"ArchiveService/SealArchive", kServer},
    {"ArchiveService/LocateArchive", kServer | kCamera | kSolver},
    {"ArchiveService/CopyArchive", kServer},
    {"ArchiveService/DeleteArchive", kServer, kAudited},
    {"ArchiveService/GetSpace", kServer},
    {"CalibrationService/FitCamera", kServer},
    {"CalibrationService/FitDisplays", kServer},
    {"CameraService/GetCamera", kPeople | kServer | kSolver},
    {"CameraService/Capture", kServer},
    {"CameraService/KeepFrames", kServer},
    {"CameraService/LookForPatches", kServer},
    {"CameraService/MeasureLight", kServer},
    {"CameraService/Preview", kPeople},
    {"CameraService/StreamFrames", kSolver},
    {"ClockService/Exchange", kAnybody},
    {"DisplayService/GetDisplay", kPeople | kServer},
    {"DisplayService/PutImage", kServer},
    {"DisplayService/LoadProgram", kServer},
    {"DisplayService/PlayProgram", kServer},
    {"EmissionService/WatchEmission", kCamera},
    {"FleetService/GetFleet", kPeople},
    {"LiveService/RunLive", kOperator, kAudited},
    {"NodeService/Register", kNodes},
    {"NodeService/ListNodes", kPeople},
    {"RigService/CalibrateSync", kOperator, kAudited},
    {"RigService/CheckRig", kOperator, kAudited},
    {"RigService/FitCalibration", kOperator, kAudited},
    {"RigService/ListCalibrations", kPeople},
    {"RigService/ForgetCalibration", kOperator, kAudited},
    {"RigService/ShowRamp", kOperator, kAudited},
    {"RigService/HoldRig", kOperator, kAudited},
    {"SessionService/CreateSession", kOperator, kAudited},
    {"SessionService/EstimateSession", kPeople},
    {"SessionService/BeginImport", kOperator, kAudited},
    {"SessionService/FinishImport", kOperator, kAudited},
    {"SessionService/UploadImage", kOperator, kAudited},
    {"SessionService/ListSessions", kPeople},
    {"SessionService/GetSession", kPeople},
    {"SessionService/WatchSession", kPeople},
    {"SessionService/PauseSession", kOperator, kAudited},
    {"SessionService/ResumeSession", kOperator, kAudited},
    {"SessionService/CancelSession", kOperator, kAudited},
    {"SessionService/DeleteSession", kOperator, kAudited},
    {"SessionService/AnnotateSession", kOperator, kAudited},
    {"SessionService/SolveSession", kOperator, kAudited},
    {"SessionService/ReplicateSession", kOperator, kAudited},
    {"SessionService/FetchMatte", kPeople, kAudited},
    {"StageService/MoveObject", kServer},
    {"WorkService/ClaimTile", kSolver},
    {"WorkService/KeepTile", kSolver},
    {"WorkService/CompleteTile", kSolver},
    {"WorkService/CompleteSurvey", kSolver},
    {"WorkService/FailTile", kSolver},
};

std::vector<std::string_view> names_of(unsigned roles) {
  std::vector<std::string_view> names;
  for (size_t role = 0; role < kRoleNames.size(); ++role) {
    if ((roles >> role & 1u) != 0) names.push_back(kRoleNames[role]);
  }
  return names;
}

unsigned roles_of(const grpc::AuthContext& caller) {
  unsigned roles = 0;
  for (const grpc::string_ref& uri : caller.FindPropertyValues(GRPC_PEER_URI_PROPERTY_NAME)) {
    const std::string_view text(uri.data(), uri.size());
    if (!text.starts_with(kRoleUri)) continue;
    const auto name = std::ranges::find(kRoleNames, text.substr(kRoleUri.size()));
    if (name != kRoleNames.end()) roles |= 1u << static_cast<unsigned>(name - kRoleNames.begin());
  }
  return roles;
}

std::string name_of(const grpc::AuthContext& caller) {
  const std::vector<grpc::string_ref> names = caller.FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME);
  return names.empty() ? "" : std::string(names.front().data(), names.front().size());
}

class RoleGate final : public grpc::AuthMetadataProcessor {
 public:
  bool IsBlocking() const override { return false; }

  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* caller, OutputMetadata*,
                       OutputMetadata*) override {
    const auto path = metadata.find(":path");
    if (path == metadata.end()) return {grpc::StatusCode::PERMISSION_DENIED, "the call names no method"};
    std::string_view method(path->second.data(), path->second.size());
    static constexpr std::string_view kOurs = "/glasswing.v1.";
    if (!method.starts_with(kOurs)) return grpc::Status::OK;
    method.remove_prefix(kOurs.size());
    const auto access = std::ranges::find(kTable, method, &MethodAccess::method);
    if (access == std::end(kTable)) return grpc::Status::OK;  // there is none: the answer says so
    const unsigned roles = roles_of(*caller);
    if ((access->roles & roles) == 0) {
      spdlog::warn("audit refused rpc={} caller=\"{}\" roles={}", method, name_of(*caller),
                   fmt::join(names_of(roles), "+"));
      return {grpc::StatusCode::PERMISSION_DENIED,
              fmt::format("{} is for the roles {}; the certificate of \"{}\" has {}", method,
                          fmt::join(names_of(access->roles), ", "), name_of(*caller),
                          roles == 0 ? "none" : fmt::format("{}", fmt::join(names_of(roles), ", ")))};
    }
    if (access->audited)
      spdlog::info("audit rpc={} caller=\"{}\" roles={}", method, name_of(*caller),
                   fmt::join(names_of(roles), "+"));
    return grpc::Status::OK;
  }
};

}  // namespace

std::span<const MethodAccess> access_table() {
  return kTable;
}

std::shared_ptr<grpc::AuthMetadataProcessor> role_gate() {
  return std::make_shared<RoleGate>();
}

}  // namespace glasswing
