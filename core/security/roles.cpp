#include "core/security/roles.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <vector>

namespace glasswing {
namespace {

constexpr Roles kOperator = only(Role::kOperator), kServer = only(Role::kServer),
                kCamera = only(Role::kCamera), kSolver = only(Role::kSolver), kConsole = only(Role::kConsole);
// An operator may what these may.
constexpr Roles kPlanner = kOperator | only(Role::kPlanner), kApprover = kOperator | only(Role::kApprover),
                kRunner = kOperator | only(Role::kRunner), kDeleter = kOperator | only(Role::kDeleter);
constexpr Roles kPeople = kPlanner | kApprover | kRunner | kDeleter | only(Role::kViewer);
// For nodes, which do not know logins: the console shows people what a viewer may see there, after asking the
// server who they are.
constexpr Roles kLookers = kPeople | kConsole;
constexpr Roles kAnybody = kPeople | kServer | kNodes;
constexpr bool kAudited = true;

constexpr MethodAccess kTable[] = {
    {"ArchiveService/CreateArchive", kServer},
    {"ArchiveService/ShareFrames", kServer},
    {"ArchiveService/GetManifest", kLookers | kServer | kCamera | kSolver},
    {"ArchiveService/ReadRows", kLookers | kServer | kCamera | kSolver},
    {"ArchiveService/ReadFile", kLookers | kServer | kCamera | kSolver},
    {"ArchiveService/PutFrame", kOperator | kConsole, kAudited},  // the console: by an import's token
    {"ArchiveService/DropFrames", kServer, kAudited},
    {"ArchiveService/SealArchive", kServer},
    {"ArchiveService/LocateArchive", kServer | kCamera | kSolver},
    {"ArchiveService/CopyArchive", kServer},
    {"ArchiveService/DeleteArchive", kServer, kAudited},
    {"ArchiveService/ListArchives", kLookers | kServer},
    {"ArchiveService/GetSpace", kLookers | kServer},
    {"AxisService/GetAxes", kLookers | kServer},
    {"AxisService/MoveAxes", kServer},
    {"AxisService/StopAxes", kServer},
    {"CalibrationService/FitCamera", kServer},
    {"CalibrationService/FitDisplays", kServer},
    {"CameraService/GetCamera", kLookers | kServer | kSolver},
    {"CameraService/Capture", kServer},
    {"CameraService/CompareFrames", kServer},
    {"CameraService/Expose", kServer},
    {"CameraService/KeepFrames", kServer},
    {"CameraService/LearnPatches", kServer},
    {"CameraService/LookForPatches", kServer},
    {"CameraService/MeasureLight", kServer},
    {"CameraService/Preview", kLookers | kServer},
    {"CameraService/StreamFrames", kSolver},
    {"CameraService/TakePicture", kServer},
    {"ClockService/Exchange", kAnybody},
    {"ConsoleService/CreateToken", kOperator, kAudited},
    {"ConsoleService/ListTokens", kOperator},
    {"ConsoleService/RevokeToken", kOperator, kAudited},
    {"ConsoleService/Announce", kConsole},
    {"ConsoleService/LogIn", kConsole},
    {"ConsoleService/LogOut", kConsole},
    {"ConsoleService/GetPrincipal", kConsole},
    {"DisplayService/GetDisplay", kLookers | kServer},
    {"DisplayService/PutImage", kServer},
    {"DisplayService/LoadProgram", kServer},
    {"DisplayService/PlayProgram", kServer},
    {"DisplayService/MoveMonitor", kServer},
    {"DisplayService/StopMove", kServer},
    {"EmissionService/WatchEmission", kCamera},
    {"FleetService/GetFleet", kPeople},
    {"JobService/SetJobPriority", kRunner, kAudited},
    {"JobService/SetJobDeadline", kRunner, kAudited},
    {"LiveService/RunLive", kOperator, kAudited},
    {"LogService/ListWarnings", kLookers},
    {"MatteService/PutMatte", kOperator, kAudited},
    {"NodeService/Register", kNodes},
    {"NodeService/ListNodes", kPeople},
    {"NodeService/GetClockHistory", kPeople},
    {"NodeService/ReleaseNode", kOperator, kAudited},
    {"QueueService/AddQueueItem", kPlanner, kAudited},
    {"QueueService/GetQueue", kPeople},
    {"QueueService/GetQueueItem", kPeople},
    {"QueueService/EditQueueItem", kPlanner, kAudited},
    {"QueueService/MoveQueueItem", kPlanner, kAudited},
    {"QueueService/DuplicateQueueItem", kPlanner, kAudited},
    {"QueueService/RemoveQueueItem", kPlanner, kAudited},
    {"QueueService/RunQueueItem", kApprover, kAudited},  // it approves the item
    {"QueueService/ApproveQueueItem", kApprover, kAudited},
    {"QueueService/SetQueue", kRunner, kAudited},
    {"QueueService/HoldQueue", kRunner, kAudited},
    {"QueueService/ReleaseQueue", kRunner, kAudited},
    {"QueueService/ListQueueHistory", kPeople},
    {"QueueService/FetchComposite", kPeople, kAudited},
    {"RigService/CalibrateSync", kOperator, kAudited},
    {"RigService/CheckRig", kRunner, kAudited},
    {"RigService/MakePlan", kPeople},
    {"RigService/FitCalibration", kOperator, kAudited},
    {"RigService/ListCalibrations", kPeople},
    {"RigService/ForgetCalibration", kOperator, kAudited},
    {"RigService/ShowRamp", kOperator, kAudited},
    {"RigService/ShowPattern", kOperator, kAudited},
    {"RigService/HoldRig", kRunner, kAudited},
    {"RigService/ReleaseRig", kRunner, kAudited},
    {"RigService/PlaceMonitor", kRunner, kAudited},
    {"RigService/PlaceObject", kRunner, kAudited},
    {"RigService/StopObject", kRunner, kAudited},
    {"SessionService/CreateSession", kRunner, kAudited},
    {"SessionService/EstimateSession", kPeople},
    {"SessionService/BeginImport", kOperator, kAudited},
    {"SessionService/FinishImport", kOperator, kAudited},
    {"SessionService/UploadImage", kPlanner | kRunner, kAudited},
    {"SessionService/ListSessions", kPeople},
    {"SessionService/GetSession", kPeople},
    {"SessionService/ListMethods", kPeople},
    {"SessionService/WatchSession", kPeople},
    {"SessionService/WatchSteps", kPeople},
    {"SessionService/PauseSession", kRunner, kAudited},
    {"SessionService/ResumeSession", kRunner, kAudited},
    {"SessionService/CancelSession", kRunner, kAudited},
    {"SessionService/DeleteSession", kDeleter, kAudited},
    {"SessionService/AnnotateSession", kRunner, kAudited},
    {"SessionService/SolveSession", kRunner, kAudited},
    {"SessionService/ReplicateSession", kOperator, kAudited},
    {"SessionService/FetchMatte", kPeople, kAudited},
    {"StageService/MoveObject", kServer},
    {"StorageService/GetUsage", kPeople},
    {"StorageService/UndeleteSession", kDeleter, kAudited},
    {"StorageService/ApplyRetention", kDeleter, kAudited},
    {"WorkService/ClaimTile", kSolver},
    {"WorkService/KeepTile", kSolver},
    {"WorkService/CompleteTile", kSolver},
    {"WorkService/CompleteSurvey", kSolver},
    {"WorkService/FailTile", kSolver},
};

}  // namespace

std::span<const MethodAccess> access_table() {
  return kTable;
}

std::string names_of(Roles roles, std::string_view between) {
  std::vector<std::string_view> names;
  for (size_t role = 0; role < kRoleNames.size(); ++role) {
    if ((roles >> role & 1u) != 0) names.push_back(kRoleNames[role]);
  }
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, between));
}

Roles role_of_uri(std::string_view uri) {
  if (!uri.starts_with(kRoleUri)) return 0;
  const auto name = std::ranges::find(kRoleNames, uri.substr(kRoleUri.size()));
  return name == kRoleNames.end() ? 0 : 1u << static_cast<unsigned>(name - kRoleNames.begin());
}

absl::Status admit(std::string_view method, Roles roles, std::string_view caller) {
  const auto access = std::ranges::find(kTable, method, &MethodAccess::method);
  if (access == std::end(kTable)) return absl::OkStatus();
  const std::string held = names_of(roles);
  if ((access->roles & roles) == 0) {
    spdlog::warn("audit refused rpc={} caller=\"{}\" roles={}", method, caller, held);
    return absl::PermissionDeniedError(fmt::format("{} is for the roles {}; \"{}\" has {}", method,
                                                   names_of(access->roles, ", "), caller,
                                                   names_of(roles, ", ")));
  }
  if (access->audited) spdlog::info("audit rpc={} caller=\"{}\" roles={}", method, caller, held);
  return absl::OkStatus();
}

}  // namespace glasswing
