// Formats of pictures with poses: transforms.json as nerfstudio and instant-ngp read it, and COLMAP's text
// model.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>

#include "compositing/dataset/dataset_files.h"
#include "compositing/dataset/dataset_format.h"
#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

nlohmann::ordered_json matrix_rows(const Eigen::Matrix4d& matrix) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int row = 0; row < 4; ++row)
    rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
  return rows;
}

class TransformsWriter final : public DatasetWriter {
 public:
  explicit TransformsWriter(const DatasetOptions& options) : options_(options) {}
  absl::Status add(const DatasetView& view) override {
    const fs::path images = options_.directory / "images";
    GW_RETURN_IF_ERROR(make_directory_durably(images));
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, options_.picture(view.matte));
    const RadianceImage coverage = coverage_of(view.matte);
    GW_RETURN_IF_ERROR(write_png(images / (view.name + ".png"), picture, &coverage));
    // The camera looks along its -z, with y up.
    const Eigen::Matrix4d to_object = Eigen::Isometry3d(view.object_to_camera).inverse().matrix() *
                                      Eigen::Vector4d(1.0, -1.0, -1.0, 1.0).asDiagonal();
    const v1::CameraGeometry& camera = view.camera;
    frames_.push_back({{"file_path", "images/" + view.name + ".png"},
                       {"fl_x", camera.fx_px()},
                       {"fl_y", camera.fy_px()},
                       {"cx", camera.cx_px()},
                       {"cy", camera.cy_px()},
                       {"w", camera.width_px()},
                       {"h", camera.height_px()},
                       {"k1", camera.k1()},
                       {"k2", camera.k2()},
                       {"k3", camera.k3()},
                       {"p1", camera.p1()},
                       {"p2", camera.p2()},
                       {"transform_matrix", matrix_rows(to_object)}});
    return absl::OkStatus();
  }
  absl::Status finish() override {
    // Readers of one camera look for its numbers beside "frames".
    nlohmann::ordered_json json = {{"camera_model", "OPENCV"}};
    for (const char* key : {"fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "p1", "p2"})
      json[key] = frames_[0][key];
    json["camera_angle_x"] =
        2.0 * std::atan(0.5 * frames_[0]["w"].get<double>() / frames_[0]["fl_x"].get<double>());
    json["frames"] = frames_;
    return write_file_durably(options_.directory / "transforms.json", json.dump(1) + "\n");
  }

 private:
  DatasetOptions options_;
  nlohmann::ordered_json frames_ = nlohmann::ordered_json::array();
};

// COLMAP's coordinates of pixels are ours. Its points are places on monitors, in the object's frame, that
// pixels beside the object saw: each view has its own, since the object turned.
class ColmapWriter final : public DatasetWriter {
 public:
  explicit ColmapWriter(const DatasetOptions& options) : options_(options) {}
  absl::Status add(const DatasetView& view) override {
    const fs::path images = options_.directory / "images";
    GW_RETURN_IF_ERROR(make_directory_durably(images));
    GW_RETURN_IF_ERROR(make_directory_durably(options_.directory / "masks"));
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, options_.picture(view.matte));
    GW_RETURN_IF_ERROR(write_png(images / (view.name + ".png"), picture));
    const RadianceImage coverage = coverage_of(view.matte);
    GW_RETURN_IF_ERROR(write_mask(options_.directory / "masks" / (view.name + ".png.png"), coverage));
    const int id = ++views_;
    images_ += fmt::format("{} {} {} {}.png\n", id, pose_text(view.object_to_camera), camera_id(view.camera),
                           view.name);
    add_points(view, id);
    return absl::OkStatus();
  }
  absl::Status finish() override {
    const fs::path model = options_.directory / "sparse/0";
    GW_RETURN_IF_ERROR(make_directory_durably(model));
    std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
    for (int i = 0; i < std::ssize(cameras_); ++i) cameras += fmt::format("{} {}\n", i + 1, cameras_[i]);
    GW_RETURN_IF_ERROR(write_file_durably(model / "cameras.txt", cameras));
    GW_RETURN_IF_ERROR(write_file_durably(model / "images.txt",
                                          "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n"
                                          "# POINTS2D[] as X Y POINT3D_ID\n" +
                                              images_));
    return write_file_durably(model / "points3D.txt",
                              "# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n" + points_);
  }

 private:
  static std::string pose_text(const Eigen::Matrix4d& pose) {
    Eigen::Quaterniond turn(Eigen::Matrix3d(pose.topLeftCorner<3, 3>()));
    turn.normalize();
    return fmt::format("{} {} {} {} {} {} {}", turn.w(), turn.x(), turn.y(), turn.z(), pose(0, 3), pose(1, 3),
                       pose(2, 3));
  }

  // The same numbers are one camera.
  int camera_id(const v1::CameraGeometry& camera) {
    std::string model = "PINHOLE";
    std::vector<double> numbers{camera.fx_px(), camera.fy_px(), camera.cx_px(), camera.cy_px()};
    if (has_distortion(camera)) {
      model = "FULL_OPENCV";
      for (const double number :
           {camera.k1(), camera.k2(), camera.p1(), camera.p2(), camera.k3(), 0.0, 0.0, 0.0})
        numbers.push_back(number);
    }
    const std::string text =
        fmt::format("{} {} {} {}", model, camera.width_px(), camera.height_px(), fmt::join(numbers, " "));
    for (int i = 0; i < std::ssize(cameras_); ++i) {
      if (cameras_[i] == text) return i + 1;
    }
    cameras_.push_back(text);
    return static_cast<int>(cameras_.size());
  }

  void add_points(const DatasetView& view, int image) {
    constexpr int kAcross = 40;  // along the picture's wider side
    const int width = view.matte.width_px(), height = view.matte.height_px();
    const int step = std::max(1, std::max(width, height) / kAcross);
    const ScreenPoints points = screen_points(view, options_.channel, false);
    const CameraLens lens(view.camera);
    const Eigen::Isometry3d to_object = Eigen::Isometry3d(view.object_to_camera).inverse();
    std::vector<std::string> seen;
    for (int y = step / 2; y < height; y += step) {
      for (int x = step / 2; x < width; x += step) {
        const int pixel = y * width + x;
        if (points.known[pixel] == 0) continue;
        const Eigen::Vector3d& at = points.at_mm[pixel];
        const Eigen::Vector2d centre(x + 0.5, y + 0.5);
        const Eigen::Vector2d projected = lens.pixel_of(at.head<2>() / at.z());
        const Eigen::Vector3d own = to_object * at;
        points_ += fmt::format("{} {} {} {} 128 128 128 {} {} {}\n", ++point_count_, own.x(), own.y(),
                               own.z(), (projected - centre).norm(), image, seen.size());
        seen.push_back(fmt::format("{} {} {}", centre.x(), centre.y(), point_count_));
      }
    }
    images_ += fmt::format("{}\n", fmt::join(seen, " "));
  }

  DatasetOptions options_;
  std::vector<std::string> cameras_;
  std::string images_, points_;
  int views_ = 0, point_count_ = 0;
};

}  // namespace

std::unique_ptr<DatasetWriter> transforms_writer(const DatasetOptions& options) {
  return std::make_unique<TransformsWriter>(options);
}

std::unique_ptr<DatasetWriter> colmap_writer(const DatasetOptions& options) {
  return std::make_unique<ColmapWriter>(options);
}

}  // namespace glasswing
