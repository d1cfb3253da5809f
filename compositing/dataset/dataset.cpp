#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "compositing/composite/backdrop.h"
#include "compositing/dataset/commands.h"
#include "compositing/dataset/dataset_format.h"
#include "compositing/picture/picture.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/composite/fast_compositor.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct DatasetArguments {
  ReadMatte read;
  std::vector<std::string> mattes, geometries, object_poses, poses, backgrounds;
  std::string format, output, archives, channel = "g";
};

// FILE, or CAMERA=FILE: for the views of one camera.
struct CameraFile {
  std::string camera, file;
};
CameraFile camera_file(const std::string& given) {
  const size_t equals = given.find('=');
  if (equals == std::string::npos || fs::exists(given)) return {.camera = "", .file = given};
  return {.camera = given.substr(0, equals), .file = given.substr(equals + 1)};
}
std::vector<CameraFile> camera_files(const std::vector<std::string>& given) {
  std::vector<CameraFile> files;
  for (const std::string& each : given) files.push_back(camera_file(each));
  return files;
}
bool names_cameras(const std::vector<CameraFile>& files) {
  return std::ranges::any_of(files, [](const CameraFile& each) { return !each.camera.empty(); });
}
// The number of that of a session's camera: "left" of session "vase-000.left" (docs/devices.md).
absl::StatusOr<size_t> of_camera(const char* option, const std::vector<CameraFile>& files,
                                 const std::string& session) {
  std::vector<std::string> cameras;
  for (size_t i = 0; i < files.size(); ++i) {
    if (session.ends_with("." + files[i].camera)) return i;
    cameras.push_back(files[i].camera);
  }
  return absl::InvalidArgumentError(
      fmt::format("{} is given for the cameras {}, but session {} has another one", option,
                  fmt::join(cameras, ", "), session));
}

const DatasetFormat& format_of(const std::string& name) {
  return *std::ranges::find(dataset_formats(), name, [](const DatasetFormat& format) { return format.name; });
}

absl::Status wrong_count(const char* option, size_t count, size_t mattes) {
  return absl::InvalidArgumentError(
      fmt::format("{} is given for {} mattes, but there are {}; give one for all, or one for each", option,
                  count, mattes));
}

// The geometry's pose of a view's monitors: as named, or that of its session, or the only one.
std::string pose_name(const v1::RigGeometry& geometry, const std::string& named, const std::string& session) {
  if (!named.empty()) return named;
  std::set<std::string> names;
  for (const v1::MonitorPose& pose : geometry.monitors()) names.insert(pose.name());
  return names.contains(session) || names.size() != 1 ? session : *names.begin();
}

absl::Status place(const v1::RigGeometry& geometry, const std::string& named, DatasetView& view) {
  const Matte& matte = view.matte;
  const int step = std::max(1, matte.metadata.sampling_px());
  view.camera = sampled_camera(geometry.camera(), step);
  if (matte.x0_px() != 0 || matte.y0_px() != 0 || matte.width_px() != view.camera.width_px() ||
      matte.height_px() != view.camera.height_px()) {
    return absl::InvalidArgumentError(
        fmt::format("the matte of {} has {}x{} px; the geometry's camera has {}x{}", view.name,
                    matte.width_px(), matte.height_px(), view.camera.width_px(), view.camera.height_px()));
  }
  const std::string pose = pose_name(geometry, named, view.name);
  for (const v1::Monitor& monitor : matte.metadata.monitors()) {
    GW_ASSIGN_OR_RETURN(const v1::MonitorPose* const found, find_pose(geometry, pose, monitor.name()));
    if (found->width_px() != monitor.width_px() || found->height_px() != monitor.height_px()) {
      return absl::InvalidArgumentError(fmt::format(
          "monitor \"{}\" of {} has {}x{} px, but in the geometry's pose \"{}\" {}x{}", monitor.name(),
          view.name, monitor.width_px(), monitor.height_px(), pose, found->width_px(), found->height_px()));
    }
    view.monitors.emplace_back(*found);
    auto& covariance = view.pose_covariances.emplace_back();
    covariance.setZero();
    if (!found->covariance().empty())
      covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(found->covariance().data());
  }
  return absl::OkStatus();
}

absl::StatusOr<RadianceImage> picture_of(const DatasetArguments& arguments, const Matte& matte) {
  constexpr float kGrey = 0.5f;
  std::vector<RadianceImage> behind;
  if (arguments.backgrounds.empty()) {
    for (const v1::Monitor& monitor : matte.metadata.monitors())
      std::ranges::fill(behind.emplace_back(monitor.width_px(), monitor.height_px()).samples, kGrey);
  } else {
    GW_ASSIGN_OR_RETURN(const PictureColours colours, PictureColours::open({}));
    BackgroundArguments pictures;
    pictures.pictures = arguments.backgrounds;
    GW_ASSIGN_OR_RETURN(Backdrop backdrop,
                        Backdrop::open(pictures, matte.metadata, colours, Encoding::kDisplay));
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const next, backdrop.next());
    behind = *next;
  }
  GW_ASSIGN_OR_RETURN(const FastCompositor compositor, FastCompositor::create(matte));
  return compositor.composite(behind);
}

// The frames of a session's archive that show the object in front of photographs, as linear EXR. Returns how
// many.
absl::StatusOr<int> write_photographs(const fs::path& archive, const fs::path& directory,
                                      const std::string& name) {
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_any_manifest(archive));
  int count = 0;
  for (const v1::Frame& frame : manifest.frames()) {
    if (!frame.object() || frame.stimulus().kind() != "photo") continue;
    GW_RETURN_IF_ERROR(make_directory_durably(directory));
    GW_ASSIGN_OR_RETURN(const CapturedPicture picture,
                        read_picture(archive / frame.file(), PictureColours(), Encoding::kLinear));
    GW_RETURN_IF_ERROR(write_radiance(directory / fmt::format("{}-{:04}.exr", name, frame.step()),
                                      picture.light, Encoding::kLinear, 0, picture.colour));
    ++count;
  }
  return count;
}

class DatasetExport {
 public:
  explicit DatasetExport(const DatasetArguments& arguments)
      : arguments_(arguments), format_(format_of(arguments.format)), directory_(arguments.output) {}

  absl::Status run(const CommandLine& command_line) {
    GW_RETURN_IF_ERROR(open());
    const std::unique_ptr<DatasetWriter> writer =
        format_.create({.directory = directory_,
                        .channel = static_cast<int>(std::ranges::find(kChannelNames, arguments_.channel) -
                                                    kChannelNames.begin()),
                        .picture = [this](const Matte& matte) { return picture_of(arguments_, matte); }});
    {
      Progress progress("views");
      for (size_t i = 0; i < arguments_.mattes.size(); ++i) {
        progress.update(static_cast<double>(i) / static_cast<double>(arguments_.mattes.size()));
        GW_ASSIGN_OR_RETURN(const DatasetView view, view_of(i));
        GW_RETURN_IF_ERROR(writer->add(view));
        if (arguments_.archives.empty()) continue;
        GW_ASSIGN_OR_RETURN(const int count, write_photographs(fs::path(arguments_.archives) / view.name,
                                                               directory_ / "photographs", view.name));
        photographs_ += count;
      }
      GW_RETURN_IF_ERROR(writer->finish());
    }
    GW_RETURN_IF_ERROR(write_file_durably(directory_ / "views.json", views_.dump(1) + "\n"));
    return describe(command_line);
  }

 private:
  absl::Status open() {
    const size_t mattes = arguments_.mattes.size();
    for (const auto& [option, given] : {std::pair{"--geometry", arguments_.geometries.size()},
                                        std::pair{"--poses", arguments_.poses.size()}}) {
      const bool by_camera = option == std::string_view("--geometry") && names_cameras(geometry_files_);
      if (given > 1 && given != mattes && !by_camera) return wrong_count(option, given, mattes);
    }
    if (format_.needs_geometry && arguments_.geometries.empty()) {
      return absl::InvalidArgumentError(
          fmt::format("--geometry is required for {}: where camera and monitors stand", format_.name));
    }
    if (format_.needs_geometry && arguments_.object_poses.empty()) {
      return absl::InvalidArgumentError(fmt::format(
          "--object-poses is required for {}: where the object stood (glasswing poses)", format_.name));
    }
    for (const auto& [option, files] :
         {std::pair{"--geometry", geometry_files_}, std::pair{"--object-poses", pose_files_}}) {
      if (names_cameras(files) && std::ranges::count(files, "", &CameraFile::camera) > 0) {
        return absl::InvalidArgumentError(
            fmt::format("{} names a camera for some files; name it for all: CAMERA=FILE", option));
      }
    }
    if (pose_files_.size() > 1 && !names_cameras(pose_files_))
      return absl::InvalidArgumentError(
          "--object-poses has several files; name the camera of each: CAMERA=FILE");
    for (const CameraFile& each : geometry_files_) {
      GW_ASSIGN_OR_RETURN(v1::RigGeometry geometry, read_geometry(each.file));
      geometries_.push_back(std::move(geometry));
    }
    for (const CameraFile& each : pose_files_) {
      GW_ASSIGN_OR_RETURN(object_poses_.emplace_back(), read_object_poses(each.file));
    }
    return make_directory_durably(directory_);
  }

  absl::StatusOr<DatasetView> view_of(size_t index) {
    DatasetView view;
    GW_ASSIGN_OR_RETURN(view.matte,
                        arguments_.read(arguments_.mattes[index], directory_ / "matte", Pyramids::kKept));
    view.name = view.matte.metadata.session();
    const absl::Status checked = check_name("session", view.name);
    if (!checked.ok()) return in_file(arguments_.mattes[index], checked);
    if (!names_.insert(view.name).second) {
      return absl::InvalidArgumentError(
          fmt::format("{} is of session {}, as another one is; views are named after their sessions",
                      arguments_.mattes[index], view.name));
    }
    nlohmann::ordered_json about = {{"name", view.name}};
    GW_RETURN_IF_ERROR(pose_object(view));
    if (!geometries_.empty()) {
      size_t number = geometries_.size() == 1 ? 0 : index;
      if (names_cameras(geometry_files_)) {
        GW_ASSIGN_OR_RETURN(number, of_camera("--geometry", geometry_files_, view.name));
        about["camera"] = geometry_files_[number].camera;
      }
      const std::vector<std::string>& poses = arguments_.poses;
      GW_RETURN_IF_ERROR(
          place(geometries_[number], poses.empty() ? "" : poses[poses.size() == 1 ? 0 : index], view));
    }
    views_.push_back(std::move(about));
    return view;
  }

  absl::Status pose_object(DatasetView& view) const {
    if (pose_files_.empty()) return absl::OkStatus();
    size_t number = 0;
    if (names_cameras(pose_files_)) {
      GW_ASSIGN_OR_RETURN(number, of_camera("--object-poses", pose_files_, view.name));
    }
    const ObjectPoses& poses = object_poses_[number];
    const auto found = poses.find(view.name);
    if (found == poses.end()) {
      std::vector<std::string> names;
      for (const auto& [name, pose] : poses) names.push_back(name);
      return absl::NotFoundError(fmt::format("{} has no pose of {}; it has: {}", pose_files_[number].file,
                                             view.name, fmt::join(names, ", ")));
    }
    view.object_to_camera = found->second;
    return absl::OkStatus();
  }

  absl::Status describe(const CommandLine& command_line) const {
    if (command_line.json) {
      const nlohmann::ordered_json written = {{"directory", arguments_.output},
                                              {"format", format_.name},
                                              {"views", names_.size()},
                                              {"photographs", photographs_}};
      std::cout << written.dump(1) << "\n";
      return absl::OkStatus();
    }
    std::cout << fmt::format("{}: {} view{}, {}\n", arguments_.output, names_.size(),
                             names_.size() == 1 ? "" : "s", format_.help);
    if (photographs_ > 0) std::cout << fmt::format("{} photographs\n", photographs_);
    return absl::OkStatus();
  }

  const DatasetArguments& arguments_;
  const DatasetFormat& format_;
  const fs::path directory_;
  const std::vector<CameraFile> geometry_files_ = camera_files(arguments_.geometries);
  const std::vector<CameraFile> pose_files_ = camera_files(arguments_.object_poses);
  std::vector<v1::RigGeometry> geometries_;
  std::vector<ObjectPoses> object_poses_;
  nlohmann::ordered_json views_ = nlohmann::ordered_json::array();  // in the order of files that are numbered
  std::set<std::string> names_;
  int photographs_ = 0;
};

void add_dataset_options(CLI::App& command, DatasetArguments& arguments) {
  command.add_option("mattes", arguments.mattes, "the views: files (.exr), or solved sessions")
      ->required()
      ->type_name("MATTE");
  std::vector<std::string> names;
  for (const DatasetFormat& format : dataset_formats()) names.emplace_back(format.name);
  command.add_option("--format", arguments.format, "whose files to write")
      ->required()
      ->check(CLI::IsMember(names));
  command.add_option("-o,--output", arguments.output, "the directory to write into")
      ->required()
      ->type_name("DIR")
      ->check(output_directory());
  command
      .add_option("--geometry", arguments.geometries,
                  "a text file of the camera and its poses (docs/rays.md); or one for each matte; or "
                  "CAMERA=FILE for each camera")
      ->type_name("FILE")
      ->delimiter(',');
  command
      .add_option(
          "--poses", arguments.poses,
          "the geometry's pose of each matte, or of all; default: named after its session, or the only one")
      ->type_name("POSE")
      ->delimiter(',');
  command
      .add_option("--object-poses", arguments.object_poses,
                  "where the object stood in each session: the file of glasswing poses; or CAMERA=FILE for "
                  "each camera")
      ->type_name("FILE")
      ->delimiter(',');
  command
      .add_option("--channel", arguments.channel, "the channel whose footprints give points on the monitor")
      ->check(CLI::IsMember(kChannelNames))
      ->capture_default_str();
  command
      .add_option("--background", arguments.backgrounds,
                  "[TEXTURE=]IMAGE: the picture behind the object in pictures; default: grey")
      ->allow_extra_args(false);
  command
      .add_option("--archives", arguments.archives,
                  "a directory of exported sessions: their frames in front of photographs become linear EXR")
      ->type_name("DIR");
}

}  // namespace

const std::vector<DatasetFormat>& dataset_formats() {
  static const std::vector<DatasetFormat> formats{
      {"transport", "sparse matrices for SciPy", false, &transport_writer},
      {"neto", "screen points, masks and cameras as NeTO reads them", true, &neto_writer},
      {"idr", "pictures, masks and cameras as IDR reads them", true, &idr_writer},
      {"transforms", "pictures and transforms.json of NeRF", true, &transforms_writer},
      {"colmap", "a text model of COLMAP", true, &colmap_writer},
      {"sofast", "fringes for OpenCSP's SOFAST", true, &sofast_writer}};
  return formats;
}

void add_dataset_command(CLI::App& app, CommandLine& command_line, ReadMatte read) {
  CLI::App& command = *app.add_subcommand("dataset", "Write mattes in the files that others' solvers read.");
  command.footer(
      "transport needs mattes only. The other formats need the geometry of the rig and the object's poses;\n"
      "their frame is the object's. docs/dataset.md lists the files of each format.\n\n"
      "Examples:\n"
      "  glasswing dataset vase.exr --format transport -o vase-transport\n"
      "  glasswing dataset vase-0*.exr --geometry rig.txtpb --object-poses poses.json --format neto -o "
      "vase-neto\n"
      "  glasswing dataset vase-000.left vase-000.right --format colmap --geometry "
      "left=left.txtpb,right=right.txtpb "
      "--object-poses left=left.json,right=right.json -o vase-colmap");
  auto arguments = std::make_shared<DatasetArguments>();
  arguments->read = std::move(read);
  add_dataset_options(command, *arguments);
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return DatasetExport(*arguments).run(command_line); };
  });
}

}  // namespace glasswing
