// A fake server with an archive node; both record the requests.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {

class FakeServer {
 public:
  FakeServer() : host_(ServiceHost::start({}, {&sessions_, &archive_}).value()) {
    sessions_.archive_address = host_->address();
  }
  const std::string& address() const { return host_->address(); }

  struct Sessions : v1::SessionService::Service {
    std::string archive_address;
    std::vector<v1::BeginImportRequest> begun;
    std::vector<std::string> finished;
    v1::Session session;  // the answer of GetSession and WatchSession
    std::string matte;
    std::map<int, std::string> frame_mattes;  // by frame of a video
    std::vector<int> frames_fetched;
    v1::MatteRegion region_fetched;  // that FetchMatte was last asked for

    grpc::Status BeginImport(grpc::ServerContext*, const v1::BeginImportRequest* request,
                             v1::BeginImportResponse* response) override {
      begun.push_back(*request);
      response->mutable_session()->set_name(request->name());
      response->mutable_session()->set_archive_address(archive_address);
      return grpc::Status::OK;
    }
    grpc::Status FinishImport(grpc::ServerContext*, const v1::FinishImportRequest* request,
                              v1::FinishImportResponse* response) override {
      finished.push_back(request->name());
      response->mutable_session()->set_name(request->name());
      response->mutable_session()->set_state(v1::SESSION_STATE_CAPTURED);
      return grpc::Status::OK;
    }
    grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                            v1::GetSessionResponse* response) override {
      *response->mutable_session() = session;
      if (session.name().empty()) response->mutable_session()->set_name(request->name());
      response->mutable_session()->set_archive_address(archive_address);
      return grpc::Status::OK;
    }
    grpc::Status SolveSession(grpc::ServerContext*, const v1::SolveSessionRequest*,
                              v1::SolveSessionResponse* response) override {
      *response->mutable_session() = session;
      return grpc::Status::OK;
    }
    grpc::Status WatchSession(grpc::ServerContext*, const v1::WatchSessionRequest* request,
                              grpc::ServerWriter<v1::WatchSessionResponse>* writer) override {
      v1::WatchSessionResponse response;
      response.mutable_session()->set_name(request->name());
      response.mutable_session()->set_state(v1::SESSION_STATE_CAPTURING);
      writer->Write(response);
      *response.mutable_session() = session;
      writer->Write(response);
      return grpc::Status::OK;
    }
    grpc::Status FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest* request,
                            grpc::ServerWriter<v1::FetchMatteResponse>* writer) override {
      v1::FetchMatteResponse response;
      response.set_chunk(request->has_frame() ? frame_mattes[request->frame()] : matte);
      if (request->has_frame()) frames_fetched.push_back(request->frame());
      region_fetched = request->region();
      writer->Write(response);
      return grpc::Status::OK;
    }
  };

  struct ArchiveNode : v1::ArchiveService::Service {
    v1::CaptureManifest manifest;
    std::map<std::string, std::string> files;  // by frame file

    grpc::Status PutFrame(grpc::ServerContext*, grpc::ServerReader<v1::PutFrameRequest>* reader,
                          v1::PutFrameResponse*) override {
      v1::PutFrameRequest request;
      if (!reader->Read(&request)) return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "nothing came");
      std::string file;
      do {
        if (request.has_frame()) {
          *manifest.add_frames() = request.frame();
          file = request.frame().file();
          files[file].clear();
        }
        files[file] += request.chunk();
      } while (reader->Read(&request));
      return grpc::Status::OK;
    }
    grpc::Status GetManifest(grpc::ServerContext*, const v1::GetManifestRequest*,
                             v1::GetManifestResponse* response) override {
      *response->mutable_manifest() = manifest;
      return grpc::Status::OK;
    }
    grpc::Status ReadFile(grpc::ServerContext*, const v1::ReadFileRequest* request,
                          grpc::ServerWriter<v1::ReadFileResponse>* writer) override {
      v1::ReadFileResponse response;
      response.set_chunk(files[request->file()]);
      writer->Write(response);
      return grpc::Status::OK;
    }
  };

  Sessions sessions_;
  ArchiveNode archive_;

 private:
  std::unique_ptr<ServiceHost> host_;
};

}  // namespace glasswing
