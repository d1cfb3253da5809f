import { useState } from "preact/hooks";
import { login } from "../api";
import { Failure } from "../parts/failure";

/** `before`: why the login could not be checked. */
export function Login({ before }: { before: unknown }) {
  const [error, setError] = useState<unknown>();
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const token = new FormData(event.currentTarget as HTMLFormElement).get("token");
    setError(undefined);
    login(String(token).trim()).catch(setError);
  };
  return (
    <form class="card login" onSubmit={submit}>
      <h1>Glasswing</h1>
      <label>
        Token
        <input name="token" type="password" required autocomplete="current-password" autofocus />
      </label>
      <button class="primary">Log in</button>
      <p class="note">
        On the rig's server, <code>glasswing console token</code> makes one.
      </p>
      {(error ?? before) !== undefined && <Failure error={error ?? before} />}
    </form>
  );
}
