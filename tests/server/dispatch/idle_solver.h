// A solver for the server's tests.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>

#include "core/base/checksum.h"
#include "core/base/version.h"
#include "core/matte/matte_file.h"
#include "core/method/methods.h"
#include "core/service/service.h"
#include "server/services/work_service.h"
#include "tests/support/status.h"

namespace glasswing {

// A solver that computes nothing: each frame's matte names its frame, and warns of its parity.
class IdleSolver {
 public:
  explicit IdleSolver(Server& server) : service_(server), host_(ServiceHost::start({}, {&service_}).value()) {
    stub_ = v1::WorkService::NewStub(dial(host_->address()));
  }
  static v1::ClaimTileRequest request() {
    v1::ClaimTileRequest request;
    request.set_solver("idle");
    request.set_version(kVersion);
    for (const auto& [method, version] : method_versions())
      (*request.mutable_method_versions())[method] = version;
    return request;
  }
  grpc::Status try_to_claim(const v1::ClaimTileRequest& request, v1::ClaimTileResponse& response) {
    grpc::ClientContext context;
    return stub_->ClaimTile(&context, request, &response);
  }
  // Claims a tile; answers surveys on the way.
  v1::ClaimTileResponse claim() {
    v1::ClaimTileResponse response;
    EXPECT_OK(try_to_claim(request(), response));
    if (response.survey_rows().empty()) return response;
    EXPECT_OK(complete_survey(response));
    return claim();
  }
  grpc::Status complete_survey(const v1::ClaimTileResponse& survey) {
    v1::CompleteSurveyRequest request;
    *request.mutable_lease() = survey.lease();
    for (int i = 0; i < survey.survey_rows_size(); ++i) request.add_row_seconds(0.1);
    v1::CompleteSurveyResponse response;
    grpc::ClientContext context;
    return stub_->CompleteSurvey(&context, request, &response);
  }
  static std::string matte(int frame, float mark) {
    Matte matte(0, 0, 5, 4, 1);
    matte.metadata.set_format_version(1);
    matte.metadata.add_monitors()->set_name("back");
    matte.metadata.set_width_px(5);
    matte.metadata.set_height_px(4);
    matte.metadata.set_frame(frame);
    matte.metadata.add_warnings(frame % 2 == 0 ? "even" : "odd");
    matte.foreground(0, 0) = {mark, mark, mark};
    return encode_matte(matte).value();
  }
  // Sends mattes of the tile's frames, without `left_out`; the last file lacks so many bytes.
  grpc::Status complete(const v1::ClaimTileResponse& tile, const std::set<int>& left_out, float mark = 1.0f,
                        size_t lacks = 0, const std::set<int>& refused = {}) {
    v1::CompleteTileResponse response;
    grpc::ClientContext context;
    const auto writer = stub_->CompleteTile(&context, &response);
    v1::CompleteTileRequest request;
    *request.mutable_lease() = tile.lease();
    request.set_object_pixel_count(10);
    for (const int frame : refused) {
      request.add_refused()->set_frame(frame);
      request.mutable_refused()->rbegin()->set_error(fmt::format("frame {}: the background moved", frame));
    }
    writer->Write(request);
    for (int frame = tile.first_frame(); frame < tile.first_frame() + tile.frame_count(); ++frame) {
      if (left_out.contains(frame) || refused.contains(frame)) continue;
      std::string bytes = matte(frame, mark);
      if (frame + 1 == tile.first_frame() + tile.frame_count()) bytes = bytes.substr(0, bytes.size() - lacks);
      v1::CompleteTileRequest chunk;
      chunk.set_frame(frame);
      chunk.set_checksum(checksum_of(matte(frame, mark)));
      chunk.set_chunk(bytes.substr(0, 100));
      writer->Write(chunk);
      chunk.clear_frame();
      chunk.clear_checksum();
      chunk.set_chunk(bytes.substr(100));
      writer->Write(chunk);
    }
    writer->WritesDone();
    return writer->Finish();
  }
  // A matte of the tile's rows, which warns of its mark.
  static std::string rows(const v1::ClaimTileResponse& tile, int width_px, int height_px, float mark) {
    Matte matte(0, tile.first_row(), width_px, tile.row_count(), 1);
    matte.metadata.set_format_version(1);
    matte.metadata.add_monitors()->set_name("back");
    matte.metadata.set_width_px(width_px);
    matte.metadata.set_height_px(height_px);
    matte.metadata.add_warnings(fmt::format("mark {}", mark));
    for (int y = 0; y < tile.row_count(); ++y) matte.foreground(0, y) = {mark, mark, mark};
    return encode_matte(matte).value();
  }
  // Sends it.
  grpc::Status complete_rows(const v1::ClaimTileResponse& tile, int width_px, int height_px, float mark) {
    return complete_rows(tile, rows(tile, width_px, height_px, mark));
  }
  grpc::Status complete_rows(const v1::ClaimTileResponse& tile, const std::string& matte) {
    v1::CompleteTileResponse response;
    grpc::ClientContext context;
    const auto writer = stub_->CompleteTile(&context, &response);
    v1::CompleteTileRequest request;
    *request.mutable_lease() = tile.lease();
    request.set_solver("idle");
    request.set_chunk(matte);
    request.set_checksum(checksum_of(request.chunk()));
    writer->Write(request);
    writer->WritesDone();
    return writer->Finish();
  }
  grpc::Status keep(const v1::ClaimTileResponse& tile) {
    v1::KeepTileRequest request;
    *request.mutable_lease() = tile.lease();
    v1::KeepTileResponse response;
    grpc::ClientContext context;
    return stub_->KeepTile(&context, request, &response);
  }
  grpc::Status fail(const v1::ClaimTileResponse& tile, const std::string& why, bool permanent = true) {
    v1::FailTileRequest request;
    *request.mutable_lease() = tile.lease();
    request.set_error(why);
    request.set_permanent(permanent);
    v1::FailTileResponse response;
    grpc::ClientContext context;
    return stub_->FailTile(&context, request, &response);
  }

 private:
  WorkServiceImpl service_;
  std::unique_ptr<ServiceHost> host_;
  std::unique_ptr<v1::WorkService::Stub> stub_;
};

}  // namespace glasswing
