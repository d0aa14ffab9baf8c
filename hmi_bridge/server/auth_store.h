#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hmi_bridge/server/auth_files.h"
#include "hmi_bridge/server/console_source.h"
#include "hmi_bridge/server/private_folder.h"
#include "pose/base/clock.h"
#include "pose/base/result.h"

namespace tbm::hmi {

struct AuthLimits {
  std::chrono::hours unused{12};
  std::chrono::hours longest{7 * 24};
  std::chrono::minutes note_use_every{5};
  std::chrono::milliseconds look_every{1000};  // at files that another process may have changed
  std::size_t sessions = 1000;                 // the longest unused make room
  int log2_n = 15;                             // of new passwords; tests take less
};

// Who is behind a request.
struct Identity {
  std::string name;
  Role role = Role::kViewer;
  bool is_token = false;     // of a program that reads; else of a session
  std::string token_sha256;  // what is asked again while a socket is open
  std::int64_t expires_at_utc_ms = 0;
};

// A session as its cookie has it.
struct OpenedSession {
  std::string token;
  Identity identity;
};

struct FirstUser {
  std::string name;
  std::string password;  // shown once
  std::string file;      // where it stands until it is changed
};

// Users, sessions and read tokens, in files of a private folder. Safe from several threads, and
// beside another process on the same folder (`hmi_bridge user add` while the bridge runs).
//
// Nothing that opens a door is kept: passwords as scrypt, tokens as SHA-256.
class AuthStore {
 public:
  static Result<std::unique_ptr<AuthStore>, std::string> Open(const std::string& folder,
                                                              const Clock& clock,
                                                              AuthLimits limits = {});

  // Makes user `surveyor` when there is none at all; empty otherwise.
  Result<std::optional<FirstUser>, std::string> MakeFirstUser();

  // The command line's. Empty: done; else a sentence.
  std::optional<std::string> AddUser(const std::string& name, Role role, std::string_view password);
  std::optional<std::string> SetPassword(const std::string& name, std::string_view password);
  std::optional<std::string> SetRole(const std::string& name, Role role);
  std::optional<std::string> RemoveUser(const std::string& name);
  struct ListedUser {
    std::string name;
    Role role = Role::kViewer;
    std::size_t open_sessions = 0;
  };
  std::vector<ListedUser> ListUsers();
  // The token's text, which is nowhere else.
  Result<std::string, std::string> AddToken(const std::string& name);
  std::optional<std::string> RemoveToken(const std::string& name);
  std::vector<ReadToken> ListTokens();

  // Takes 0.1 s and 32 MB, for a name that is not there as well. Empty: name or password is wrong.
  // The error is of the disk.
  Result<std::optional<OpenedSession>, std::string> LogIn(const std::string& name,
                                                          std::string_view password);
  std::optional<std::string> LogOut(const std::string& token_sha256);

  std::optional<Identity> OfSession(std::string_view token);
  std::optional<Identity> OfReadToken(std::string_view token);
  // Whether what was found before still holds. Counts as a use: who looks at a screen for a shift
  // asks for nothing.
  bool StillHolds(const Identity& identity);

  // Writes when sessions were last used if that is old enough. Empty: nothing to tell.
  std::optional<std::string> KeepUses();
  // A file that another process has damaged: what was read before stays in force. Each once.
  std::vector<std::string> TakeFaults();

 private:
  template <class Entry>
  struct File {
    std::string_view name;
    std::vector<Entry> rows;
    FileStamp stamp;
    FileStamp refused;  // damaged, and told
  };

  AuthStore(PrivateFolder folder, const Clock& clock, AuthLimits limits);

  std::int64_t Now_utc_ms() const;
  template <class Entry>
  struct Rows {
    std::vector<Entry> rows;
    FileStamp stamp;
  };
  template <class Entry>
  Result<Rows<Entry>, std::string> Read(const File<Entry>& file) const;
  template <class Entry>
  void Take(File<Entry>& file, Rows<Entry> read);
  // Reads what is newest, lets `change` alter it (or say why not), and keeps that. Called without
  // `mutex_`, which `change` runs under: who asks for a session never waits for the disk.
  template <class Entry, class Change>
  std::optional<std::string> Alter(File<Entry>& file, Change change);
  template <class Entry>
  void LookAt(File<Entry>& file);
  void Look();

  const User* FindUser(std::string_view name) const;
  std::int64_t ExpiresAt(const Session& session) const;
  const User* UserOf(const Session& session) const;
  Session* FindSession(std::string_view token_sha256);
  void TakeNewestUses(std::vector<Session>& rows) const;
  void DropWorthless(std::vector<Session>& rows) const;
  std::optional<Identity> IdentityOf(std::string_view token_sha256);
  void ForgetFirstPassword(const std::string& name);

  const PrivateFolder folder_;
  const Clock& clock_;
  const AuthLimits limits_;
  const PasswordHash nobody_;  // what an unknown name is compared with

  std::mutex changing_;  // one change of a file at a time; before `mutex_`
  std::mutex mutex_;
  File<User> users_{"users.json", {}, {}, {}};
  File<Session> sessions_{"sessions.json", {}, {}, {}};
  File<ReadToken> tokens_{"tokens.json", {}, {}, {}};
  std::chrono::steady_clock::time_point looked_at_{};
  std::int64_t uses_kept_utc_ms_ = 0;
  std::vector<std::string> faults_;
};

// Whether a password may be chosen; empty: it may.
std::optional<std::string> WhyNotPassword(std::string_view name, std::string_view password);

}  // namespace tbm::hmi
