using System;
using System.Collections.Generic;
using System.IO;
using Google.Protobuf;

namespace GraspClient
{
    /// <summary>A call that the server refused, or that did not reach it.</summary>
    public sealed class GraspException : Exception
    {
        const string BadRequest = "google.rpc.BadRequest";

        /// <summary>The code in lower case, such as "invalid_argument", "not_found" or "unavailable".</summary>
        public string Code { get; private set; }

        /// <summary>Every wrong field of the request, "holdout.object: …"; empty if that is not the cause.</summary>
        public IReadOnlyList<string> Violations { get; private set; }

        /// <param name="details">Standard details: the type's full name and the message's bytes.</param>
        public GraspException(string code, string message, IEnumerable<KeyValuePair<string, byte[]>> details)
            : base(message)
        {
            Code = code;
            var violations = new List<string>();
            foreach (KeyValuePair<string, byte[]> detail in details)
            {
                if (detail.Key == BadRequest)
                {
                    foreach (byte[] violation in Parts(detail.Value, 1))
                    {
                        violations.Add(Text(violation, 1) + ": " + Text(violation, 2));
                    }
                }
            }
            Violations = violations;
        }

        /// <summary>The details of a google.rpc.Status in binary form.</summary>
        public static IEnumerable<KeyValuePair<string, byte[]>> DetailsOf(byte[] status)
        {
            foreach (byte[] any in Parts(status, 3))
            {
                string url = Text(any, 1);
                foreach (byte[] value in Parts(any, 2))
                {
                    yield return new KeyValuePair<string, byte[]>(url.Substring(url.LastIndexOf('/') + 1), value);
                }
            }
        }

        static string Text(byte[] message, int field)
        {
            string text = "";
            foreach (byte[] part in Parts(message, field))
            {
                text = System.Text.Encoding.UTF8.GetString(part);
            }
            return text;
        }

        /// <summary>The values of a field of bytes, strings or messages.</summary>
        static List<byte[]> Parts(byte[] message, int field)
        {
            var parts = new List<byte[]>();
            var input = new CodedInputStream(message);
            try
            {
                for (uint tag = input.ReadTag(); tag != 0; tag = input.ReadTag())
                {
                    if (tag == (uint)(field << 3 | 2))
                    {
                        parts.Add(input.ReadBytes().ToByteArray());
                    }
                    else
                    {
                        input.SkipLastField();
                    }
                }
            }
            catch (IOException)
            {
                // Damaged details: the message alone has to do.
            }
            return parts;
        }
    }
}
