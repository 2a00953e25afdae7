using System;
using System.Collections.Generic;
using System.Text;
using System.Threading;
using System.Threading.Tasks;
using Google.Protobuf;
using UnityEngine;
using UnityEngine.Networking;

namespace GraspClient
{
    /// <summary>The Connect protocol with JSON, by UnityWebRequest: runs everywhere, also in WebGL.</summary>
    public sealed class ConnectTransport : GraspTransport
    {
        static readonly JsonParser Parser = new JsonParser(JsonParser.Settings.Default.WithIgnoreUnknownFields(true));

        readonly string address;
        readonly CancellationTokenSource disposed = new CancellationTokenSource();

        public ConnectTransport(string address)
        {
            this.address = address.TrimEnd('/');
        }

        public override async Task<TAnswer> Call<TRequest, TAnswer>(
            string method, TRequest request, TimeSpan deadline, CancellationToken cancel)
        {
            byte[] body = Encoding.UTF8.GetBytes(JsonFormatter.Default.Format(request));
            using (CancellationTokenSource ends = CancellationTokenSource.CreateLinkedTokenSource(cancel, disposed.Token))
            using (var web = new UnityWebRequest(address + "/" + method, "POST"))
            {
                web.uploadHandler = new UploadHandlerRaw(body);
                web.downloadHandler = new DownloadHandlerBuffer();
                web.SetRequestHeader("Content-Type", "application/json");
                web.SetRequestHeader("Connect-Protocol-Version", "1");
                web.SetRequestHeader("Connect-Timeout-Ms", ((long)deadline.TotalMilliseconds).ToString());
                web.timeout = (int)Math.Ceiling(deadline.TotalSeconds) + 1;
                var done = new TaskCompletionSource<bool>();
                UnityWebRequestAsyncOperation operation = web.SendWebRequest();
                operation.completed += _ => done.TrySetResult(true);
                using (ends.Token.Register(web.Abort))
                {
                    await done.Task;
                }
                ends.Token.ThrowIfCancellationRequested();
                if (web.responseCode == 200)
                {
                    return Parser.Parse<TAnswer>(web.downloadHandler.text);
                }
                throw Error(web);
            }
        }

        public override void Dispose()
        {
            disposed.Cancel();
        }

        static GraspException Error(UnityWebRequest web)
        {
            ConnectError error = null;
            try
            {
                error = JsonUtility.FromJson<ConnectError>(web.downloadHandler.text);
            }
            catch (ArgumentException)
            {
                // A proxy's page.
            }
            var details = new List<KeyValuePair<string, byte[]>>();
            if (error == null || string.IsNullOrEmpty(error.code))
            {
                return new GraspException("unavailable", web.url + ": " + web.error, details);
            }
            foreach (ConnectDetail detail in error.details ?? new ConnectDetail[0])
            {
                string padded = detail.value.PadRight((detail.value.Length + 3) / 4 * 4, '=');
                details.Add(new KeyValuePair<string, byte[]>(detail.type, Convert.FromBase64String(padded)));
            }
            return new GraspException(error.code, error.message, details);
        }

        [Serializable]
        sealed class ConnectError
        {
            public string code = null;
            public string message = null;
            public ConnectDetail[] details = null;
        }

        [Serializable]
        sealed class ConnectDetail
        {
            public string type = null;
            public string value = null;
        }
    }
}
