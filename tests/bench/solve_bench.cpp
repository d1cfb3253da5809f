// Solves a whole archive in the page cache with glasswing-solver, and compares the time with reading its
// files.
#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <stdexcept>
#include <thread>

#include "core/footprint/footprint.h"
#include "core/frame/archive.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kWidth = 1280, kHeight = 720;
constexpr double kStripe_px = 17.0, kNoise = 0.002;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// An archive of 600 frames of four sweeps: an object over a third of the frame, one footprint in 70 % of its
// pixels' channels and two in the others, in front of a monitor that the camera sees one to one.
class BigArchive {
 public:
  BigArchive() : directory_(fs::temp_directory_path() / fmt::format("glasswing-bench-{}", ::getpid())) {
    fmt::print("writing an archive of {} x {} px and 604 frames, 3.3 GB\n", kWidth, kHeight);
    fs::create_directories(directory_ / "frames");
    compressed_ = directory_ / "compressed";
    fs::create_directories(compressed_ / "frames");
    std::mt19937 random(41);
    std::uniform_real_distribution<float> share(0.0f, 1.0f);
    std::normal_distribution<float> noise(0.0f, static_cast<float>(kNoise));
    modes_.resize(static_cast<size_t>(kWidth) * kHeight * 3 * 2);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double u = (x - kWidth / 2) / 420.0, v = (y - kHeight / 2) / 235.0;
        const bool object = u * u + v * v < 1.0;
        for (int c = 0; c < 3; ++c) {
          Footprint* mode = &modes_[(static_cast<size_t>(y * kWidth + x) * 3 + c) * 2];
          mode[0] = {
              .weight = 0.9, .x_px = x + 0.5, .y_px = y + 0.5, .xx_px2 = 0.0, .xy_px2 = 0.0, .yy_px2 = 0.0};
          if (!object) continue;
          // Upside down, as in a glass ball; slightly dispersed.
          const auto shape = [&](double weight, double px, double py) {
            return Footprint{.weight = weight,
                             .x_px = px + 0.4 * c,
                             .y_px = py,
                             .xx_px2 = 20.0 + 60.0 * u * u,
                             .xy_px2 = 20.0 * u * v,
                             .yy_px2 = 20.0 + 60.0 * v * v};
          };
          mode[0] = shape(0.6, kWidth * (0.5 - 0.4 * u), kHeight * (0.5 - 0.4 * v));
          if (share(random) < 0.3f)
            mode[1] = shape(0.25, kWidth * (0.5 + 0.3 * v), kHeight * (0.5 + 0.3 * u));
        }
      }
    }
    for (float& value : noise_) value = noise(random);
    v1::Camera& camera = *manifest_.mutable_camera();
    camera.set_width_px(kWidth);
    camera.set_height_px(kHeight);
    camera.set_bits(12);
    camera.set_read_sd(kNoise);
    v1::Monitor& monitor = *manifest_.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(kWidth);
    monitor.set_height_px(kHeight);
    manifest_.set_format_version(1);
    manifest_.set_session("bench");
    for (const double value : {0.0, 1.0}) {
      for (const bool object : {true, false}) add_solid(value, object);
    }
    for (const double degrees : {0.0, 90.0, 45.0, -45.0}) add_sweep(degrees);
    write_manifest(directory_, manifest_);
    write_manifest(compressed_, manifest_);
    // The same files under a second name: twice the frames, and every stripe taken twice.
    twice_ = directory_ / "twice";
    fs::create_directories(twice_);
    fs::create_directory_symlink(directory_ / "frames", twice_ / "frames");
    fs::create_directory_symlink(directory_ / "frames", twice_ / "again");
    v1::CaptureManifest twice = manifest_;
    for (v1::Frame frame : manifest_.frames()) {
      frame.set_file("again" + frame.file().substr(6));
      *twice.add_frames() = frame;
    }
    write_manifest(twice_, twice);
  }
  ~BigArchive() { fs::remove_all(directory_); }

  double cat_seconds() const {
    const Clock::time_point start = Clock::now();
    if (std::system(fmt::format("cat {}/frames/*.tif > /dev/null", directory_.string()).c_str()) != 0)
      return NAN;
    return seconds_since(start);
  }

  struct Solve {
    double seconds = 0.0;
    double peak_gib = 0.0;  // resident, mapped files not counted
  };
  enum class Frames { kPlain, kTwice, kCompressed };
  // Runs the program, so that the memory measured is the solve's alone.
  Solve solve(Frames frames) const {
    const std::string program = fs::read_symlink("/proc/self/exe").parent_path() / "glasswing-solver";
    const std::string from = frames == Frames::kTwice        ? twice_
                             : frames == Frames::kCompressed ? compressed_
                                                             : directory_;
    const std::string to = directory_ / "matte.exr";
    Solve solve;
    const Clock::time_point start = Clock::now();
    // Returns when the program has replaced this one: a forked child would still have this one's memory.
    std::vector<std::string> words{program, "solve", from, to};
    char* const arguments[] = {words[0].data(), words[1].data(), words[2].data(), words[3].data(), nullptr};
    pid_t child = 0;
    if (::posix_spawn(&child, program.c_str(), nullptr, nullptr, arguments, environ) != 0)
      throw std::runtime_error(program + " cannot be started");
    int status = 0;
    while (::waitpid(child, &status, WNOHANG) == 0) {
      std::ifstream memory(fmt::format("/proc/{}/status", child));
      for (std::string line; std::getline(memory, line);) {
        if (line.starts_with("RssAnon:"))
          solve.peak_gib = std::max(solve.peak_gib, std::stod(line.substr(8)) / (1 << 20));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    solve.seconds = seconds_since(start);
    if (status != 0) throw std::runtime_error(program + " failed");
    return solve;
  }

 private:
  static void write_manifest(const fs::path& directory, const v1::CaptureManifest& manifest) {
    google::protobuf::util::JsonPrintOptions options;
    options.preserve_proto_field_names = true;
    std::string json;
    (void)google::protobuf::util::MessageToJsonString(manifest, &json, options);
    std::ofstream(directory / "manifest.json") << json;
  }

  std::uint16_t code(double value, size_t i) {
    const double noisy =
        value + static_cast<double>(noise_[(i * 7919 + frame_count_ * 104729) % noise_.size()]);
    return static_cast<std::uint16_t>(std::lround(std::clamp(noisy, 0.0, 1.0) * 4095.0) * 16);
  }

  v1::Stimulus& store(const Image16& image, bool object) {
    v1::Frame& frame = *manifest_.add_frames();
    frame.set_file(fmt::format("frames/{:06}.tif", frame_count_++));
    frame.set_object(object);
    frame.set_exposure_ms(4.0);
    std::ofstream(directory_ / frame.file(), std::ios::binary) << encode_tiff(image);
    std::ofstream(compressed_ / frame.file(), std::ios::binary) << encode_tiff(image, FrameForm::kCompressed);
    frame.mutable_stimulus()->set_panel("back");
    return *frame.mutable_stimulus();
  }

  void add_solid(double value, bool object) {
    Image16 image(kWidth, kHeight);
    for (size_t i = 0; i < image.samples.size(); ++i) {
      const double light = object ? modes_[2 * i].weight + modes_[2 * i + 1].weight : 0.9;
      image.samples[i] = code(0.02 + value * light, i);
    }
    v1::Stimulus& stimulus = store(image, object);
    stimulus.set_kind("solid");
    for (int c = 0; c < 3; ++c) stimulus.add_colour(value);
  }

  void add_sweep(double degrees) {
    const double phi = degrees * std::numbers::pi / 180.0;
    const StripeAxis axis{.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = kStripe_px};
    struct Line {
      float centre, inverse, peak;
    };
    std::vector<Line> lines;
    lines.reserve(modes_.size());
    for (const Footprint& mode : modes_) {
      const double sigma = std::sqrt(answered_variance(mode, axis));
      lines.push_back({static_cast<float>(mode.x_px * axis.cos_phi + mode.y_px * axis.sin_phi),
                       static_cast<float>(1.0 / sigma),
                       static_cast<float>(mode.weight * kStripe_px / sigma)});
    }
    double low = 0.0, high = 0.0;
    for (const double x : {0.0, static_cast<double>(kWidth)}) {
      for (const double y : {0.0, static_cast<double>(kHeight)}) {
        low = std::min(low, x * axis.cos_phi + y * axis.sin_phi);
        high = std::max(high, x * axis.cos_phi + y * axis.sin_phi);
      }
    }
    Image16 image(kWidth, kHeight);
    for (double r = low - 2.0 * kStripe_px; r <= high + 2.0 * kStripe_px; r += 0.5 * kStripe_px) {
      for (size_t i = 0; i < image.samples.size(); ++i) {
        float value = 0.02f;
        for (size_t m = 2 * i; m < 2 * i + 2; ++m) {
          const float z = (static_cast<float>(r) - lines[m].centre) * lines[m].inverse;
          if (lines[m].peak > 0.0f && std::abs(z) < 5.0f) value += lines[m].peak * std::exp(-0.5f * z * z);
        }
        image.samples[i] = code(static_cast<double>(value), i);
      }
      v1::Stimulus& stimulus = store(image, true);
      stimulus.set_kind("gauss_stripe");
      stimulus.set_phi_deg(degrees);
      stimulus.set_r_px(r);
      stimulus.set_sigma_px(kStripe_px);
      stimulus.set_peak(1.0);
    }
  }

  const fs::path directory_;
  fs::path twice_, compressed_;
  std::vector<Footprint> modes_;
  std::array<float, 65537> noise_;
  v1::CaptureManifest manifest_;
  size_t frame_count_ = 0;
};

const BigArchive& archive() {
  static const BigArchive written;
  return written;
}

struct Figures {
  double ratio = 0.0, peak_gib = 0.0;
  double compressed_ratio = 0.0, compressed_peak_gib = 0.0;  // of compressed frames; time over plain ones
};

Figures measure() {
  using Frames = BigArchive::Frames;
  std::vector<double> cat, solve, compressed;
  Figures figures;
  for (int i = 0; i < 5; ++i) {
    cat.push_back(archive().cat_seconds());
    const BigArchive::Solve one = archive().solve(Frames::kPlain),
                            other = archive().solve(Frames::kCompressed);
    solve.push_back(one.seconds);
    compressed.push_back(other.seconds);
    figures.peak_gib = std::max(figures.peak_gib, one.peak_gib);
    figures.compressed_peak_gib = std::max(figures.compressed_peak_gib, other.peak_gib);
    fmt::print("cat {:.2f} s, solve {:.2f} s, {:.2f} GiB; compressed frames {:.2f} s, {:.2f} GiB\n",
               cat.back(), one.seconds, one.peak_gib, other.seconds, other.peak_gib);
  }
  for (std::vector<double>* seconds : {&cat, &solve, &compressed}) std::ranges::sort(*seconds);
  figures.compressed_ratio = compressed[compressed.size() / 2] / solve[solve.size() / 2];
  figures.ratio = solve[solve.size() / 2] / cat[cat.size() / 2];
  return figures;
}

}  // namespace

void add_solve_rows(std::vector<Row>& rows) {
  static const auto figures = [] {
    static const Figures measured = measure();
    return measured;
  };
  rows.push_back(
      {"whole solve, 1280x720, 600 frames in page cache: time over cat", "x", {}, [](const Rates&) {
         return figures().ratio;
       }});
  rows.push_back({"whole solve: peak resident memory, maps not counted", "GiB", {}, [](const Rates&) {
                    return figures().peak_gib;
                  }});
  rows.push_back({"whole solve: the same with twice the frames", "GiB", {}, [](const Rates&) {
                    return archive().solve(BigArchive::Frames::kTwice).peak_gib;
                  }});
  rows.push_back({"whole solve of compressed frames: time over plain ones", "x", {}, [](const Rates&) {
                    return figures().compressed_ratio;
                  }});
  rows.push_back({"whole solve of compressed frames: peak resident memory", "GiB", {}, [](const Rates&) {
                    return figures().compressed_peak_gib;
                  }});
}

}  // namespace glasswing
