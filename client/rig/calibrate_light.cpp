#include "client/rig/calibrate_light.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>

#include "client/capture/capture.h"
#include "client/capture/watch.h"
#include "client/cli/rpc.h"
#include "client/rig/curve_chart.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kFitTimeout(10);

constexpr const char* kCameraGuide =
    "Measuring the light of the camera's codes. Nothing on the stage, the room dark or its light "
    "steady; automatic exposure, gain and white balance off, and the aperture and gain that you will capture "
    "with.\n";
constexpr const char* kDisplayGuide =
    "Measuring the light of the monitors' codes. Nothing on the stage; monitors warm (half an "
    "hour), their automatic brightness, dynamic contrast and night colours off.\n";

double percent(double share) {
  return 100.0 * share;
}

std::string by_channel(const std::vector<double>& values, const char* format) {
  std::string text;
  for (const double value : values)
    text += (text.empty() ? "" : " / ") + fmt::format(fmt::runtime(format), value);
  return text;
}

void print_warnings(const google::protobuf::RepeatedPtrField<std::string>& warnings) {
  for (const std::string& warning : warnings) std::cout << "  warning     " << printable(warning) << "\n";
}

double largest(const google::protobuf::RepeatedField<float>& values) {
  return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end());
}

void print_camera(const v1::CameraCalibration& camera) {
  std::vector<double> black, error;
  for (const v1::CameraCurve& curve : camera.curves()) {
    black.push_back(percent(curve.black_level()));
    double worst = 0.0;
    for (int k = 0; k < curve.error_size(); ++k) {
      const double code = static_cast<double>(k) / std::max(curve.error_size() - 1, 1);
      if (code >= curve.darkest_seen() && code <= curve.brightest_seen())
        worst = std::max(worst, static_cast<double>(curve.error(k)));
    }
    error.push_back(percent(worst));
  }
  std::cout
      << fmt::format("camera {}, measured {}\n", camera.camera(), camera.measured())
      << fmt::format("  curve       {}; standard error up to {} % of full scale (r / g / b)\n",
                     camera.linear() ? "straight: the camera is linear" : "curved",
                     by_channel(error, "{:.2f}"))
      << fmt::format("  black       {} % of the codes; saturated from {:.1f} %\n",
                     by_channel(black, "{:.2f}"), percent(camera.saturation()))
      << fmt::format(
             "  noise       read {:.3f} % of full scale, shot gain {:.2e}: signal to noise {:.0f} at full "
             "scale\n",
             percent(camera.read_sd()), camera.shot_gain(),
             1.0 / std::sqrt(std::max(camera.read_sd() * camera.read_sd() + camera.shot_gain(), 1e-12)));
  if (camera.has_fall_off()) {
    std::cout << fmt::format("  fall-off    corners have {:.1f} % of the centre's light\n",
                             percent(1.0 + camera.fall_off().r2() + camera.fall_off().r4()));
  }
  if (camera.white_ms() > 0.0)
    std::cout << fmt::format("  exposure    white reaches full scale at {:.2f} ms: expose for less\n",
                             camera.white_ms());
  print_warnings(camera.warnings());
}

void print_display(const v1::DisplayCalibration& display) {
  std::vector<double> gamma, residual, error;
  for (const v1::ToneCurve& curve : display.primaries()) {
    gamma.push_back(curve.gamma());
    residual.push_back(percent(curve.residual_rms()));
    error.push_back(percent(largest(curve.error())));
  }
  std::cout << fmt::format("monitor {}, measured {}\n", display.monitor(), display.measured())
            << fmt::format(
                   "  curve       gamma {} (r / g / b), followed to {} % rms; standard error up to {} %\n",
                   by_channel(gamma, "{:.2f}"), by_channel(residual, "{:.2f}"), by_channel(error, "{:.2f}"));
  double white = 0.0, black = 0.0, stray = 0.0;
  for (int c = 0; c < 3 && display.crosstalk_size() == 9; ++c) {
    double row = 0.0;
    for (int p = 0; p < 3; ++p) row += display.crosstalk(3 * c + p);
    for (int p = 0; p < 3; ++p) {
      if (p != c && row > 0.0) stray = std::max(stray, display.crosstalk(3 * c + p) / row);
    }
    white += row / 3.0;
    black += display.black_size() == 3 ? display.black(c) / 3.0 : 0.0;
  }
  std::cout
      << fmt::format(
             "  contrast    {:.0f} : 1 in this room; white has {:.0f} % of the camera's scale at {:.3g} ms\n",
             black > 0.0 ? (white + black) / black : 0.0, percent(white), display.exposure_ms())
      << fmt::format("  crosstalk   at most {:.1f} % of a primary in another channel\n", percent(stray))
      << fmt::format("  drift       {:.2f} % during the measurement\n", percent(display.drift()));
  if (display.has_uniformity() && !display.uniformity().light().empty()) {
    const auto [low, high] =
        std::minmax_element(display.uniformity().light().begin(), display.uniformity().light().end());
    std::cout << fmt::format("  evenness    {:.1f} to {:.1f} % of the centre's light\n", percent(*low),
                             percent(*high));
  }
  print_warnings(display.warnings());
}

template <typename Calibration>
absl::Status write_chart(const std::string& charts, const std::string& name, const Calibration& calibration) {
  const std::filesystem::path path = std::filesystem::path(charts) / (name + ".svg");
  GW_RETURN_IF_ERROR(write_file_durably(path, chart_of(calibration)));
  std::cout << "  picture     " << path.string() << "\n";
  return absl::OkStatus();
}

template <typename Message>  // has displays()
absl::Status print_all(const Client& client, const Message& message, const std::string& charts,
                       const std::vector<v1::CameraCalibration>& cameras) {
  if (client.json) {
    print_json(message);
    return absl::OkStatus();
  }
  for (const v1::CameraCalibration& camera : cameras) {
    print_camera(camera);
    if (!charts.empty()) GW_RETURN_IF_ERROR(write_chart(charts, "camera-" + camera.camera(), camera));
  }
  for (const v1::DisplayCalibration& display : message.displays()) {
    print_display(display);
    if (!charts.empty()) GW_RETURN_IF_ERROR(write_chart(charts, "monitor-" + display.monitor(), display));
  }
  return absl::OkStatus();
}

// Captures the plan as a new session and returns its name.
absl::StatusOr<std::string> captured(const Client& client, const v1::Plan& plan) {
  v1::CreateSessionRequest request;
  std::string stamp = utc_now_rfc3339();
  std::erase_if(stamp, [](char c) { return c == '-' || c == ':'; });
  request.set_name(fmt::format("calibrate-{}-{}", plan.calibration().of(), stamp));
  *request.mutable_plan() = plan;
  GW_ASSIGN_OR_RETURN(const v1::Session begun, create_session(client, std::move(request)));
  const absl::StatusOr<v1::Session> followed = follow(client, begun.name());
  if (absl::IsCancelled(followed.status())) {
    return absl::CancelledError(fmt::format("{}; when it is captured: glasswing calibrate {} --session {}",
                                            std::string(followed.status().message()), plan.calibration().of(),
                                            begun.name()));
  }
  GW_ASSIGN_OR_RETURN(const v1::Session session, followed);
  if (const absl::Status outcome = outcome_of(session); !outcome.ok()) {
    return absl::Status(outcome.code(),
                        fmt::format("{}; when it is captured: glasswing calibrate {} --session {}",
                                    std::string(outcome.message()), plan.calibration().of(), session.name()));
  }
  return session.name();
}

absl::StatusOr<v1::FitCalibrationResponse> fitted_by(const Peer<v1::RigService>& server,
                                                     const v1::FitCalibrationRequest& request) {
  grpc::ClientContext context;
  set_deadline(context, kFitTimeout);
  const Interruptible ctrl_c([&context] { context.TryCancel(); });
  const Waiting waiting("fitting");
  v1::FitCalibrationResponse fitted;
  const grpc::Status status = server.stub->FitCalibration(&context, request, &fitted);
  if (interrupted())
    return absl::CancelledError("the server continues fitting; glasswing calibrate list shows the result");
  if (!status.ok()) return status_from(status, server.title);
  return fitted;
}

absl::Status fit(const Client& client, const std::string& session, const std::string& charts) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  v1::FitCalibrationRequest request;
  request.set_session(session);
  GW_ASSIGN_OR_RETURN(const v1::FitCalibrationResponse fitted, fitted_by(server, request));
  std::vector<v1::CameraCalibration> cameras;
  if (fitted.has_camera()) cameras.push_back(fitted.camera());
  GW_RETURN_IF_ERROR(print_all(client, fitted, charts, cameras));
  for (const std::string& why : fitted.unmeasured())
    std::cerr << "not measured: " << printable(why)
              << "; point the camera at it, then: glasswing calibrate display --monitor NAME\n";
  return absl::OkStatus();
}

// The plan to calibrate for, or an empty one. Adds its monitors to `arguments` unless others are named.
absl::StatusOr<v1::Plan> plan_of(CalibrateArguments& arguments) {
  if (arguments.plan.empty()) return v1::Plan();
  GW_ASSIGN_OR_RETURN(v1::Plan plan, read_plan(arguments.plan));
  if (arguments.monitors.empty()) {
    for (const v1::PlanMonitor& monitor : plan.monitors()) arguments.monitors.push_back(monitor.name());
  }
  if (arguments.camera.empty()) arguments.camera = plan.camera();
  return plan;
}

absl::StatusOr<v1::ListCalibrationsResponse> known(const Client& client) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  return call_pages(server, &v1::RigService::Stub::ListCalibrations, {});
}

// Captures the server's plan for this request, and fits it.
absl::Status calibrate(const Client& client, const CalibrateArguments& arguments, v1::MakePlanRequest request,
                       const char* guide) {
  for (const std::string& name : arguments.monitors) request.add_monitors(name);
  request.set_camera(arguments.camera);
  const Peer<v1::RigService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::MakePlanResponse made,
                      call(server, &v1::RigService::Stub::MakePlan, request, kLongCallTimeout));
  if (!client.json) {
    for (const std::string& note : made.notes()) std::cerr << printable(note) << "\n";
  }
  if (!made.has_plan()) return absl::OkStatus();
  if (!client.json) std::cerr << guide;
  GW_ASSIGN_OR_RETURN(const std::string session, captured(client, made.plan()));
  return fit(client, session, arguments.charts);
}

}  // namespace

absl::Status calibrate_camera_light(const Client& client, const CalibrateArguments& given) {
  if (!given.session.empty()) return fit(client, given.session, given.charts);
  CalibrateArguments arguments = given;
  GW_ASSIGN_OR_RETURN(const v1::Plan plan, plan_of(arguments));
  v1::MakePlanRequest request;
  request.set_purpose(v1::PLAN_PURPOSE_CALIBRATE_CAMERA);
  for (const double exposure_ms : plan.exposure_ms())
    request.set_longest_exposure_ms(std::max(request.longest_exposure_ms(), exposure_ms));
  return calibrate(client, arguments, std::move(request), kCameraGuide);
}

absl::Status calibrate_display_light(const Client& client, const CalibrateArguments& given) {
  if (!given.session.empty()) return fit(client, given.session, given.charts);
  CalibrateArguments arguments = given;
  GW_RETURN_IF_ERROR(plan_of(arguments).status());
  v1::MakePlanRequest request;
  request.set_purpose(v1::PLAN_PURPOSE_CALIBRATE_DISPLAYS);
  return calibrate(client, arguments, std::move(request), kDisplayGuide);
}

absl::Status list_calibrations(const Client& client, const std::string& charts) {
  GW_ASSIGN_OR_RETURN(const v1::ListCalibrationsResponse calibrations, known(client));
  if (client.tsv) {
    std::vector<std::vector<std::string>> rows;
    for (const v1::CameraCalibration& camera : calibrations.cameras())
      rows.push_back({"camera", camera.camera(), camera.measured(),
                      fmt::format("{}", fmt::join(camera.warnings(), "; "))});
    for (const v1::DisplayCalibration& display : calibrations.displays())
      rows.push_back({"monitor", display.monitor(), display.measured(),
                      fmt::format("{}", fmt::join(display.warnings(), "; "))});
    print_table(client, {{"KIND"}, {"NAME"}, {"MEASURED"}, {"WARNINGS"}}, rows);
    return absl::OkStatus();
  }
  if (calibrations.cameras().empty() && calibrations.displays().empty() && !client.json)
    std::cout << "No camera or monitor is calibrated; run glasswing calibrate all.\n";
  return print_all(client, calibrations, charts,
                   {calibrations.cameras().begin(), calibrations.cameras().end()});
}

absl::Status forget_calibration(const Client& client, const std::string& device) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  v1::ForgetCalibrationRequest request;
  request.set_device(device);
  GW_ASSIGN_OR_RETURN(const v1::ForgetCalibrationResponse forgotten,
                      call(server, &v1::RigService::Stub::ForgetCalibration, request));
  if (client.json) print_json(forgotten);
  return absl::OkStatus();
}

}  // namespace glasswing
