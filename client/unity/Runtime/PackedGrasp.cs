using System;
using System.Text;
using UnityEngine;

namespace GraspClient
{
    /// <summary>A grasp as a game server passes it on to other players: Grasp.packed of an answer.</summary>
    public sealed class PackedGrasp
    {
        const int Header = 22;
        const int DigitBytes = 6;

        /// <summary>True for a right hand.</summary>
        public bool IsRight { get; private set; }

        /// <summary>The digits that touch, thumb first, then the palm.</summary>
        public bool[] Touching { get; private set; }

        /// <summary>Number of the GraspType; 0 without one.</summary>
        public int Type { get; private set; }

        /// <summary>Number of the Convention of <see cref="ObjectFromWrist"/>.</summary>
        public int Convention { get; private set; }

        /// <summary>The hand's size over its rig's.</summary>
        public float Scale { get; private set; }

        /// <summary>The wrist's joint in the object's frame, in the convention's axes and unit.</summary>
        public Pose ObjectFromWrist { get; private set; }

        /// <summary>The rig, such as "rigs/adult".</summary>
        public string Rig { get; private set; }

        /// <summary>Base yaw, base pitch, second pitch and third pitch in radians of each digit, thumb first; null for one that the
        /// hand does not have.</summary>
        public float[][] Digits { get; private set; }

        /// <summary>Reads the bytes of Grasp.packed.</summary>
        /// <exception cref="FormatException">They are no packed grasp of version 1.</exception>
        public static PackedGrasp Read(byte[] bytes)
        {
            if (bytes.Length < Header || bytes[0] != 1)
            {
                throw new FormatException("not a packed grasp of version 1");
            }
            var grasp = new PackedGrasp
            {
                IsRight = (bytes[1] & 1) != 0,
                Type = bytes[3],
                Convention = bytes[4],
                Scale = bytes[5] / 100f,
                Touching = new bool[6],
                Digits = new float[5][],
            };
            for (int bit = 0; bit < 6; bit++)
            {
                grasp.Touching[bit] = (bytes[2] >> bit & 1) != 0;
            }
            float unit = Mathf.Pow(2, (sbyte)bytes[6]);
            var position = new Vector3(Short(bytes, 7), Short(bytes, 9), Short(bytes, 11)) * unit;
            var orientation = new Quaternion(Short(bytes, 13), Short(bytes, 15), Short(bytes, 17), Short(bytes, 19));
            grasp.ObjectFromWrist = new Pose(position, Quaternion.Normalize(orientation));
            int at = Header + bytes[21];
            int digits = 0;
            for (int digit = 0; digit < 5; digit++)
            {
                digits += bytes[1] >> digit + 1 & 1;
            }
            if (bytes.Length != at + digits * DigitBytes)
            {
                throw new FormatException("a packed grasp is incomplete or too long: it has " + bytes.Length + " bytes");
            }
            grasp.Rig = "rigs/" + Encoding.ASCII.GetString(bytes, Header, bytes[21]);
            for (int digit = 0; digit < 5; digit++)
            {
                if ((bytes[1] >> digit + 1 & 1) == 0)
                {
                    continue;
                }
                grasp.Digits[digit] = new[]
                {
                    Angle(bytes[at] | (bytes[at + 1] & 15) << 8),
                    Angle(bytes[at + 1] >> 4 | bytes[at + 2] << 4),
                    Angle(bytes[at + 3] | (bytes[at + 4] & 15) << 8),
                    Angle(bytes[at + 4] >> 4 | bytes[at + 5] << 4),
                };
                at += DigitBytes;
            }
            return grasp;
        }

        static short Short(byte[] bytes, int at)
        {
            return (short)(bytes[at] | bytes[at + 1] << 8);
        }

        static float Angle(int step)
        {
            return (step - 2048) * Mathf.PI / 2048;
        }
    }
}
