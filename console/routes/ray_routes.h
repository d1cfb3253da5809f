// What browsers ask about rays of two sessions (docs/rays.md).
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include <atomic>
#include <mutex>
#include <string>

#include "console/rays/made_rays.h"
#include "console/routes/server_link.h"

namespace glasswing {

// Answers errors by refuse(). The server checks that a person may have the mattes; nothing is kept. Bodies
// are the text of a geometry, as `glasswing calibrate geometry` writes it.
//
// Parameters of a request for rays: `near` and `far` name the sessions, in any order; `near_pose` and
// `far_pose` the geometry's poses, if they are not named as the sessions; with `lossless` the object absorbs
// nothing.
class RayRoutes {
 public:
  static constexpr size_t kMaxGeometry = size_t{1} << 20;  // bytes of its text
  static constexpr int kMaxMakes = 4;                      // one at work, the others wait

  explicit RayRoutes(const ServerLink& server);

  // The geometry as JSON.
  void read_geometry(const Login& login, const httplib::Request& request, const std::string& text,
                     httplib::Response& response) const;
  // One line of JSON and the planes of a web matte (docs/console.md).
  void make(const Login& login, const httplib::Request& request, const std::string& geometry,
            httplib::Response& response) const;
  // The file that `glasswing rays` writes.
  void make_file(const Login& login, const httplib::Request& request, const std::string& geometry,
                 httplib::Response& response) const;

 private:
  absl::StatusOr<std::string> made(const Login& login, const httplib::Request& request,
                                   const std::string& geometry, bool as_file) const;

  const ServerLink& server_;
  const RayLimits limits_;
  mutable std::atomic<int> makes_ = 0;
  mutable std::mutex making_;  // held while rays are made, which takes memory: one at a time
};

}  // namespace glasswing
